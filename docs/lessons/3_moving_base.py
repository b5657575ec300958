# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 3. A robot's wrench on a moving base
#
# Under the robot sits a force-torque sensor. What it feels is weight, the robot's own motion, and the motion of the
# platform that carries it. The Newton-Euler recursion (Appendix A of the report) gives all three at once.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

puma = ves.load_robot("puma560")
q = puma.joints
mass, centre, inertia = ves.composite_body(puma, q)
print(f"{len(puma.joint_names)} joints, {mass:.2f} kg, centre {np.round(centre, 3)} m from its foot")

# %% [markdown]
# ## Outward, then inward
#
# Velocities and accelerations go from the base to the hand, link by link; forces come back:
#
# $$ \mathbf F_i = m_i \dot{\mathbf v}_{C_i}, \qquad
#    \mathbf N_i = I_i \dot{\boldsymbol\omega}_i + \boldsymbol\omega_i \times I_i \boldsymbol\omega_i $$
#
# Gravity comes for free: a robot at rest on Earth feels what one that is pushed up at $g$ would feel in space. So `a`,
# the acceleration of the base *less gravity*, is $\{0, 0, 9.81\}$ at rest.

# %%
still = 0 * q
at_rest, efforts = ves.newton_euler(puma, q, still, still)
print("on the robot from its foot:", np.round(at_rest, 2))
print("joint efforts [N m]:       ", np.round(efforts, 2))
assert np.allclose(at_rest[:3], [0, 0, mass * 9.81])
assert np.allclose(at_rest[3:], np.cross(centre, at_rest[:3]))
# The weight is the other side of it: gravity compensation subtracts it, (B.4).
assert np.allclose(at_rest, -ves.gravity_wrench(puma, q), atol=1e-9)

# %% [markdown]
# ## The robot moves, the base moves, both
#
# The report splits the wrench: the robot moving on a fixed base, and the robot *locked* on the moving one, (3.1):
#
# $$ \mathbf W \approx \mathbf W_{\text{robot}}(q, \dot q, \ddot q) + M_1(q)\,
#    \begin{pmatrix} \mathbf a \\ \boldsymbol\alpha \end{pmatrix} $$
#
# What is left out are products of the two motions, such as Coriolis forces. How large is that? Joint 2 swings while
# the base rocks about $y$.

# %%
t = np.linspace(0, 4, 401)
rock, w_rock = 0.02, 2 * np.pi * 0.5     # [rad], [rad/s] of the base
swing, w_swing = 0.5, 2 * np.pi * 0.4    # of joint 2
whole, split = [], []
for time in t:
    joint, rate, acceleration = q.copy(), still.copy(), still.copy()
    joint[1] += swing * np.sin(w_swing * time)
    rate[1] = swing * w_swing * np.cos(w_swing * time)
    acceleration[1] = -swing * w_swing**2 * np.sin(w_swing * time)
    w = np.array([0, rock * w_rock * np.cos(w_rock * time), 0])
    alpha = np.array([0, -rock * w_rock**2 * np.sin(w_rock * time), 0])
    whole.append(ves.newton_euler(puma, joint, rate, acceleration, w, alpha, (0, 0, 0))[0])
    moving = ves.newton_euler(puma, joint, rate, acceleration, a=(0, 0, 0))[0]
    locked = ves.newton_euler(puma, joint, still, still, (0, 0, 0), alpha, (0, 0, 0))[0]
    split.append(moving + locked)
whole, split = np.array(whole), np.array(split)
left_out = np.abs(whole - split).max(0)
print("largest      ", np.round(np.abs(whole).max(0), 2))
print("left out     ", np.round(left_out, 2))

# %%
figure, (force, rest) = plt.subplots(1, 2, figsize=(10, 4))
force.plot(t, whole[:, 0], label="whole"); force.plot(t, split[:, 0], "--", label="split, (3.1)")
force.set(xlabel="time [s]", ylabel="force x [N]", title="in space: joint 2 swings, the base rocks"); force.legend()
rest.plot(t, (whole - split)[:, 0], color="tab:red")
rest.set(xlabel="time [s]", ylabel="[N]", title="what the split leaves out")
plt.tight_layout(); plt.show()
share = left_out[0] / np.abs(whole[:, 0]).max()
print(f"{100 * share:.1f} % of the force in x")
assert share < 0.02

# %% [markdown]
# The split "appears to be valid", says the report (4.3). With the robots and bases of the Shuttle's arm it errs by at most
# 0.33 % of the motion: `./ves srms simulate srms_low_hover_doss` prints it.
#
# ## Exercise
#
# The platform lifts the robot with 1 m/s² and the robot holds still, on Earth. What does the foot press down with?

# %% answer
# The whole robot accelerates as one body: m (g + a).
answer = mass * (9.81 + 1.0)
pressed, _ = ves.newton_euler(puma, q, still, still, a=(0, 0, 9.81 + 1.0))
print(f"{answer:.1f} N")
assert abs(pressed[2] - answer) < 1e-9
