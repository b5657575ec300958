# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 7. Admittance control: force in, motion out
#
# A real spring takes a displacement and answers with a force. A machine that pretends to be something else has to choose
# what it measures and what it commands. *Impedance* control measures motion and commands force; it wants motors whose force
# is known. A hydraulic leg is the opposite: it goes where it is told, whatever pushes. So it is *admittance* control here:
# a sensor measures the force, a model answers with a motion, and stiff servos follow it.
#
# $$ m\,\ddot x + c\,\dot x + k\,x = F $$
#
# That is all there is to the vehicle of Table 4.1, six times. Push it, and see.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

m, c, k = 500.0, 500.0, 1500.0  # x of Table 4.1
push, lasts, begins = 20.0, 0.2, 0.5  # [N], [s], [s]

def step(t):
    """x of a base at rest, on which 1 N acts from 0 on: (C.3) with one mode."""
    t = np.maximum(t, 0)
    decay, turn = c / m / 2, np.sqrt(k / m - (c / m / 2) ** 2)
    return (1 - np.exp(-decay * t) * (np.cos(turn * t) + decay / turn * np.sin(turn * t))) / k

def pushed(t):
    return push * (step(t - begins) - step(t - begins - lasts))

# %% [markdown]
# ## The same finger on the machine
#
# `push` is an event of a scenario: a force on what the sensor carries. Nobody tells the controller. It finds it in the
# sensor's counts, 100 times a second, and the legs go where the model says. As published the legs lag; then with their lag
# taken out.

# %%
program = ("[{move: {}}, {calibration: {}}, {admittance: {duration_s: 8}, robot: [{at_s: 0.5, duration_s: 0.2, "
           "push: {on: platform, force_n: [20, 0, 0]}}]}]")
quiet = {"sensor.noise": False, "program": program}
compensated = {f"controller.compensation.{part}": True for part in ("feed_forward", "observer", "inertia")}

def admittance(settings):
    run = ves.run("free_decay", {**quiet, **settings})
    assert run.phase == "parked"
    on = run["segment"] == 2
    return run["t_s"][on] - run["t_s"][on][0], run["x_actual_m"][on]

plt.figure(figsize=(7, 4))
t = np.linspace(0, 8, 801)
plt.plot(t, 1e3 * pushed(t), color="0.2", label="the base, in closed form")
off = {}
for name, settings, colour in (("as published", {}, "tab:orange"), ("compensated", compensated, "tab:blue")):
    t, x = admittance(settings)
    off[name] = np.sqrt(np.mean((x - pushed(t)) ** 2)) / np.abs(pushed(t)).max()
    plt.plot(t, 1e3 * x, "--", color=colour, label=f"the platform, {name}")
plt.xlabel("time [s]"); plt.ylabel("x [mm]"); plt.legend(); plt.grid(alpha=0.3)
plt.title("20 N for 0.2 s"); plt.show()
for name, share in off.items():
    print(f"{name:12s} off by {100 * share:5.2f} % of the amplitude, rms")
assert off["compensated"] < 0.03 < off["as published"]

# %% [markdown]
# The free-space simulation of Chapter 3 knows of the push too, and is the closed form.

# %%
t, free = ves.simulate_base("free_decay", quiet)
print(f"at most {np.abs(free[:, 0] - pushed(t)).max():.1e} m apart")
assert np.abs(free[:, 0] - pushed(t)).max() < 1e-8

# %% [markdown]
# ## What the parameters do
#
# A short push is an impulse $p = F\,\Delta t$: right after it the base moves with nearly $p/m$ (in 0.2 s damper and spring
# have taken some of it). How far it goes then is the spring's business, and how long it swings the damper's. `./ves demo --view` has sliders for all three.

# %%
for name, scale in (("as it is", (1, 1, 1)), ("twice the mass", (2, 1, 1)), ("four times the stiffness", (1, 1, 4))):
    mass, damping, stiffness = np.array(scale) * (m, c, k)
    base = ves.modes(mass * np.eye(6), damping * np.eye(6), stiffness * np.eye(6))
    eta = eta_dot = np.zeros(6)
    x, v = [], []
    for tick in range(800):
        wrench = [push if tick < 20 else 0, 0, 0, 0, 0, 0]
        eta, eta_dot = ves.admittance_step(base, eta, eta_dot, wrench, 0.01)[:2]
        x.append((base.shapes @ eta)[0]); v.append((base.shapes @ eta_dot)[0])
    print(f"{name:25s} after the push {1e3 * v[19]:5.2f} mm/s (p/m {1e3 * push * lasts / mass:5.2f}), at most {1e3 * max(x):5.2f} mm")

# %% [markdown]
# ## Exercise
#
# Two masses meet: what the sensor carries has mass too. With a robot of mass $m_1$ on the base the same push moves both.
# What is the speed after it, as the free-space simulation has it, for the PUMA on Table 4.1? And what must the model's
# answer to the sensor's wrench leave out, so that the platform does the same?

# %% answer
robot = ves.load_robot("puma560")
mass, centre, _ = ves.composite_body(robot, np.zeros(6))
print(f"the arm weighs {mass:.1f} kg: {1e3 * push * lasts / (m + mass):.2f} mm/s if it were a point at the platform")
# The sensor feels the push less what accelerates the robot. Fed back as it is, the robot's inertia comes one sample late
# (lesson 5); compensation puts it on the model's left-hand side, (3.11), and takes it out of the wrench.
