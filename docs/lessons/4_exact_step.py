# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 4. An exact step against Euler and Runge-Kutta
#
# The admittance model turns the measured wrench into motion, 100 times a second. Between two ticks the wrench is
# *held*. For a linear model that makes the step exact, whatever its length: there is nothing to integrate.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

# %% [markdown]
# ## The zero-order hold
#
# One mode of a base, (C.4): $\ddot\eta + 2\zeta\omega\,\dot\eta + \omega^2 \eta = u$. With
# $\mathbf y = \{\eta, \dot\eta\}$ and $u$ held over $T$, Appendix D:
#
# $$ \mathbf y(t+T) = \Phi\,\mathbf y(t) + \Gamma u, \qquad \Phi = e^{AT}, \qquad
#    \Gamma = \int_0^T e^{A\tau} d\tau\, B \qquad (D.5) $$

# %%
omega, zeta, T = 2 * np.pi * 2.0, 0.02, 0.01
k, c = omega**2, 2 * zeta * omega
Phi, Gamma = ves.second_order_hold(k, c, T)
print("Phi\n", Phi, "\nGamma", Gamma)

A = np.array([[0, 1], [-k, -c]])
B = np.array([0, 1.0])

def euler(y, u):
    return y + T * (A @ y + B * u)

def rk4(y, u):
    f = lambda y: A @ y + B * u
    a = f(y); b = f(y + T / 2 * a); c_ = f(y + T / 2 * b); d = f(y + T * c_)
    return y + T / 6 * (a + 2 * b + 2 * c_ + d)

def exact(y, u):
    return Phi @ y + Gamma * u

# %% [markdown]
# ## A mode that rings
#
# The mode begins 50 mm aside and rings freely. The closed form is
# $\eta = \eta_0 e^{-\zeta\omega t}\left(\cos\omega_d t + \frac{\zeta\omega}{\omega_d}\sin\omega_d t\right)$.

# %%
n = 1000
omega_d = omega * np.sqrt(1 - zeta**2)
t = T * np.arange(n + 1)
truth = 0.05 * np.exp(-zeta * omega * t) * (np.cos(omega_d * t) + zeta * omega / omega_d * np.sin(omega_d * t))
paths = {}
for name, step in (("Euler", euler), ("Runge-Kutta 4", rk4), ("exact", exact)):
    y, path = np.array([0.05, 0.0]), [0.05]
    for _ in range(n):
        y = step(y, 0.0)
        path.append(y[0])
    paths[name] = np.array(path)
    print(f"{name:14s} off by {np.abs(paths[name] - truth).max():.1e} m within 10 s")
assert np.abs(paths["exact"] - truth).max() < 1e-13
assert np.abs(paths["Runge-Kutta 4"] - truth).max() > 1e-7
assert np.abs(paths["Euler"]).max() > 1.0

# %%
figure, (curve, error) = plt.subplots(1, 2, figsize=(10, 4))
for name, colour in (("Euler", "tab:red"), ("Runge-Kutta 4", "tab:orange"), ("exact", "tab:blue")):
    curve.plot(t, 1e3 * paths[name], color=colour, label=name, lw=1)
    error.semilogy(t, np.maximum(np.abs(paths[name] - truth), 1e-18), color=colour, lw=1)
curve.set(xlim=(0, 3), ylim=(-120, 120), xlabel="time [s]", ylabel="[mm]", title="2 Hz, 2 % damping, 100 steps a second")
curve.legend(loc="upper left")
error.set(xlabel="time [s]", ylabel="error [m]", title="from the closed form")
plt.tight_layout(); plt.show()

# %% [markdown]
# Euler's step adds energy: a mode that should ring down rings up. It is stable only where
# $\omega T < 2\zeta$, here below $0.04$; this mode has $\omega T = 0.126$. That is not a detail: a base that gains energy
# from its integrator throws the robot. Runge-Kutta is good as long as the mode is slow; the Shuttle's arm has modes up to
# tens of hertz. The exact step costs one 2 by 2 product a mode.
#
# `ves.admittance_step` is the same for a whole base, modes coupled by damping or not.

# %%
base = ves.load_base("table_4_1")
eta, eta_dot = np.zeros(6), np.zeros(6)
wrench = np.array([0, 0, 40.0, 0, 0, 0])
for _ in range(500):
    eta, eta_dot = ves.admittance_step(base, eta, eta_dot, wrench, T)
once, _ = ves.admittance_step(base, np.zeros(6), np.zeros(6), wrench, 500 * T)
print("z after 5 s: in 500 steps {:.9f} m, in one {:.9f} m".format((base.shapes @ eta)[2], (base.shapes @ once)[2]))
assert np.allclose(eta, once, atol=1e-12)

# %% [markdown]
# ## Exercise
#
# Without damping, up to which frequency is Runge-Kutta 4 stable at 100 steps a second?

# %% answer
# Its polynomial 1 + z + z^2/2 + z^3/6 + z^4/24 has magnitude 1 on the imaginary axis at |z| = 2 sqrt(2).
limit = 2 * np.sqrt(2) / T / (2 * np.pi)
print(f"{limit:.1f} Hz")
size = lambda f: abs(np.polyval([1 / 24, 1 / 6, 1 / 2, 1, 1], 2j * np.pi * f * T))
assert size(0.999 * limit) < 1 < size(1.001 * limit)
