# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 2. Why adding angles is wrong and a twist is right
#
# Three angles describe an attitude. Their rates are not an angular velocity, and adding a small rotation to the
# angles turns the platform about the wrong axes. The report draws the distinction in (2.26); many programs do not.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

def turned(w):
    """The rotation by |w| about w (Rodrigues)."""
    angle = np.linalg.norm(w)
    if angle == 0:
        return np.eye(3)
    k = np.asarray(w) / angle
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K

def apart(R, Q):
    """The angle [deg] between two attitudes."""
    return np.degrees(np.arccos(np.clip((np.trace(R.T @ Q) - 1) / 2, -1, 1)))

# %% [markdown]
# ## The angles of the report
#
# X-Y-Z fixed angles: turn by $\alpha$ about the fixed $x$, then by $\beta$ about the fixed $y$, then by $\gamma$
# about the fixed $z$, equation (2.19):
#
# $$ R_{IP} = R_z(\gamma)\, R_y(\beta)\, R_x(\alpha) $$
#
# The order matters, so the rates of the three do not simply add up. What they do is a matrix, the inverse of (2.27b):
#
# $$ \boldsymbol\omega_{IP} = E(\alpha,\beta,\gamma)
#    \begin{pmatrix} \dot\alpha \\ \dot\beta \\ \dot\gamma \end{pmatrix}, \qquad
#    E = \begin{pmatrix} c_\beta c_\gamma & -s_\gamma & 0 \\ c_\beta s_\gamma & c_\gamma & 0 \\
#        -s_\beta & 0 & 1 \end{pmatrix} $$

# %%
angles = np.array([0.3, 0.4, -0.2])
print(np.round(ves.angle_rate_map(angles), 3))
# The columns are where a rate points: compare with a difference of rotations.
step = 1e-6
for i in range(3):
    dR = (ves.rotation(angles + step * np.eye(3)[i]) - ves.rotation(angles - step * np.eye(3)[i])) / (2 * step)
    W = dR @ ves.rotation(angles).T  # the skew matrix of the angular velocity
    assert np.allclose([W[2, 1], W[0, 2], W[1, 0]], ves.angle_rate_map(angles)[:, i], atol=1e-8)

# %% [markdown]
# ## A body that turns steadily
#
# Let a body turn with a constant $\boldsymbol\omega$. We know where it goes: $R(t) = \exp([\boldsymbol\omega] t)$.
# Three programs integrate it in steps of 10 ms: one adds $\boldsymbol\omega\,\Delta t$ to the angles, one maps it
# through $E^{-1}$ first, one multiplies by the rotation of the twist.

# %%
w, dt, n = np.array([0.5, 0.4, 0.3]), 0.01, 200
added, mapped, twisted = np.zeros(3), np.zeros(3), np.eye(3)
errors = []
for k in range(1, n + 1):
    added = added + w * dt
    mapped = mapped + np.linalg.solve(ves.angle_rate_map(mapped), w) * dt
    twisted = turned(w * dt) @ twisted
    truth = turned(w * k * dt)
    errors.append([apart(ves.rotation(added), truth), apart(ves.rotation(mapped), truth), apart(twisted, truth)])
errors = np.array(errors)
print("after 2 s [deg]: added {:.2f}, mapped {:.3f}, twist {:.1e}".format(*errors[-1]))
assert errors[-1, 0] > 5 and errors[-1, 1] < 1 and errors[-1, 2] < 1e-5

# %%
plt.figure(figsize=(7, 4))
for column, name in zip(errors.T, ("added to the angles", "through E, Euler's step", "as a twist")):
    plt.semilogy(dt * np.arange(1, n + 1), np.maximum(column, 1e-7), label=name)
plt.xlabel("time [s]"); plt.ylabel("attitude wrong by [deg]"); plt.legend(); plt.grid(alpha=0.3)
plt.title("a body that turns steadily")
plt.show()

# %% [markdown]
# The first is wrong by degrees whatever the step: it is another motion. The second is right and has Euler's error,
# which a smaller step makes smaller. The third is exact.
#
# In the forward kinematics a Newton step is a twist $\{\mathbf v, \boldsymbol\omega\}$ from the legs' Jacobian, whose
# row for leg $i$ is $\{\mathbf d_i, \mathbf r_i \times \mathbf d_i\}$. Applied as a rotation it keeps Newton's quadratic
# convergence; added to the angles it is only as good as the platform is level.

# %%
platform = ves.load_platform("z_sine")
pose = np.array([0.05, 0.0, 0.05, 0.4, 0.35, -0.4])
lengths = ves.leg_lengths(platform, pose)

def newton(as_twist, steps=9):
    x, left = np.zeros(6), []
    for _ in range(steps):
        R, p = ves.rotation(x[3:]), x[:3] + [0, 0, platform.home_height]
        r = platform.platform_joints @ R.T
        d = p + r - platform.base_joints
        left.append(np.abs(np.linalg.norm(d, axis=1) - lengths).max())
        twist = np.linalg.solve(np.hstack([d, np.cross(r, d)]),
                                0.5 * (lengths**2 - np.sum(d**2, axis=1)))
        x[:3] += twist[:3]
        x[3:] = ves.fixed_angles(turned(twist[3:]) @ R) if as_twist else x[3:] + twist[3:]
    return np.array(left)

print("error of the legs [m], step by step")
print("as a twist ", " ".join(f"{e:.0e}" for e in newton(True)))
print("as angles  ", " ".join(f"{e:.0e}" for e in newton(False)))
assert newton(True)[4] < 1e-9 < newton(False)[4]

# %% [markdown]
# ## Exercise
#
# The platform is pitched by $\beta = 60^\circ$, $\alpha = \gamma = 0$, and only $\alpha$ changes, by 1 rad/s. What is
# its angular velocity in the inertial frame?

# %% answer
# The first column of E: (cos beta, 0, -sin beta). It turns about the platform's own x axis, which points down.
w = np.array([0.5, 0.0, -np.sqrt(3) / 2])
assert np.allclose(w, ves.angle_rate_map([0, np.pi / 3, 0])[:, 0])
print(w)
