# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 8. An arm that turns a satellite
#
# Nothing holds a satellite. Its robot's joints can give vehicle and robot together no angular momentum, and yet they can turn
# it: a cat that is dropped lands on its feet. A vehicle on springs cannot be turned so: whatever the arm does, it comes back.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

side = 60  # [deg] of a joint

def loops(n):
    """Joints 2 and 3 go round a square n times, a side in 2 s."""
    corners = [("joint_2", -90 + side), ("joint_3", 45 - side), ("joint_2", -90), ("joint_3", 45)]
    return ", ".join(f"{{at_s: {1 + 3 * k}, duration_s: 2, joint: {joint}, to_deg_or_m: {to}}}"
                     for k, (joint, to) in enumerate(n * corners))

def program(n):
    return f"[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: {{duration_s: {12 * n + 10}}}, robot: [{loops(n)}]}}]"

satellite = {"robot.joints_deg_or_m": [0, -90, 45, 0, 0, 0]}
springs = {**satellite, "base": "!replace {mass_diagonal: [500, 500, 500, 120, 120, 120], damping_diagonal: [500, 500, 500, 150, 150, 150], "
                   "stiffness_diagonal: [2000, 2000, 2000, 800, 800, 800]}"}

# %% [markdown]
# ## A flat satellite, by hand
#
# A body of mass $m_0$ and a link of mass $m_1$ in a plane, the joint at $r$ from the body's centre, the link's centre at $l$ from
# the joint. With no angular momentum, the body turns by $d\theta$ as the joint turns by $d\varphi$:
#
# $$ d\theta = -\frac{I_1 + \mu l^2 + \mu r l \cos\varphi}{I_0 + I_1 + \mu(r^2 + l^2) + 2 \mu r l \cos\varphi}\, d\varphi,
#    \qquad \mu = \frac{m_0 m_1}{m_0 + m_1} $$
#
# One joint alone turns it back on its way back. But a whole turn of the joint is a way that ends where it began, too:

# %%
m0, m1, I0, I1, r, l = 500.0, 50.0, 80.0, 4.0, 0.5, 0.6
mu = m0 * m1 / (m0 + m1)
A, B, D = I0 + I1 + mu * (r**2 + l**2), 2 * mu * r * l, I1 + mu * l**2 - I0 - mu * r**2
phi = np.linspace(0, 2 * np.pi, 20001)
turn = -(I1 + mu * l**2 + mu * r * l * np.cos(phi)) / (A + B * np.cos(phi))
numeric = np.sum(0.5 * (turn[1:] + turn[:-1]) * np.diff(phi))
closed = -np.pi - np.pi * D / np.sqrt(A**2 - B**2)
print(f"one turn of the link turns the body by {np.degrees(numeric):.6f} deg; in closed form by {np.degrees(closed):.6f}")
assert abs(numeric - closed) < 1e-9

# %% [markdown]
# ## A PUMA 560 on half a ton
#
# Its joints do not turn all the way, but two of them can go round a square. In free space, by the momentum of vehicle and robot
# (chapter 3 with a body that floats):

# %%
plt.figure(figsize=(7, 4))
left = {}
for name, settings, colour in (("afloat", satellite, "tab:blue"), ("on springs", springs, "tab:orange")):
    t, x = ves.simulate_base("satellite_puma", {"program": program(4), **settings})
    plt.plot(t, np.degrees(x[:, 4]), color=colour, label=name)
    left[name] = np.degrees(x[-1, 4])
for k in range(5):
    plt.axvline(1 + 12 * k, color="0.85", zorder=0)
plt.xlabel("time [s]"); plt.ylabel("beta [deg]"); plt.legend(); plt.grid(alpha=0.3)
plt.title("the joints go round a square four times"); plt.show()
for name, angle in left.items():
    print(f"{name:11s} turned by {angle:8.4f} deg in the end")
assert abs(left["on springs"]) < 0.01 < abs(left["afloat"])

# %% [markdown]
# The square the other way round turns it the other way; the order of two motions is what counts, and not their sum.
#
# ## The platform shows it
#
# In the VES the satellite is an admittance model, its input the wrench under the robot. It knows nothing of loops:

# %%
run = ves.run("satellite_puma", {"program": program(4), **satellite})
on = run["segment"] == 2
shown = np.degrees(run["beta_actual_rad"][on][-1])
print(f"the platform is left turned by {shown:.4f} deg, with the sensor's noise")
assert run.phase == "parked" and abs(shown - left["afloat"]) < 0.01 * abs(left["afloat"])

# %% [markdown]
# ## Exercise
#
# Does the turn grow with the square's side, or with its area?
#
# *Answer.* For a small square it is the area times a curvature, as Stokes' theorem has it: half the side, about a quarter of the
# turn. Begin with joint 3 at 90 degrees instead of 45, and it is an eighth: there the curvature passes through zero.

# %%
full = abs(left["afloat"]) / 4
side = 30
_, x = ves.simulate_base("satellite_puma", {"program": program(1), **satellite})
print(f"a square of 60 deg turns it by {full:.4f} deg, one of 30 deg by {abs(np.degrees(x[-1, 4])):.4f}")
assert 0.15 < abs(np.degrees(x[-1, 4])) / full < 0.4
