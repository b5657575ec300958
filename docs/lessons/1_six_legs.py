# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 1. The platform and its six legs
#
# A Stewart platform is a plate on six legs whose lengths change. Six lengths, six coordinates: position
# $x, y, z$ and three angles. This lesson goes from a pose to the lengths, which is easy, and back, which is not.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

platform = ves.load_platform("z_sine")  # the machine of the report
B, P, h = platform.base_joints, platform.platform_joints, platform.home_height
print(f"home at {h} m; ball joints on circles of {np.linalg.norm(B[0]):.2f} and {np.linalg.norm(P[0]):.2f} m")

# %% [markdown]
# ## From a pose to the lengths
#
# Leg $i$ goes from $B_i$, fixed in the inertial frame $I$, to $P_i$, fixed in the platform $P$. With the
# platform at $\mathbf p$, turned by $R$, report equations (C.11) and (C.12):
#
# $$ L_i = \left| \mathbf p + R\,\mathbf P_i - \mathbf B_i \right| $$
#
# `ves.leg_lengths` is that line. A pose counts from home, so $\mathbf p$ begins at the home height.

# %%
pose = np.array([0.05, -0.02, 0.10, 0.05, -0.08, 0.10])
R = ves.rotation(pose[3:])
by_hand = [np.linalg.norm(pose[:3] + [0, 0, h] + R @ p - b) for p, b in zip(P, B)]
lengths = ves.leg_lengths(platform, pose)
print("by hand ", np.round(by_hand, 4))
print("ves     ", np.round(lengths, 4))
assert np.allclose(lengths, by_hand, atol=1e-12)

# %%
figure, (top, curve) = plt.subplots(1, 2, figsize=(10, 4))
home, now = P + [0, 0, h], (P @ R.T) + pose[:3] + [0, 0, h]
for b, p, q in zip(B, home, now):
    top.plot(*zip(b[:2], p[:2]), color="0.8", lw=4)
    top.plot(*zip(b[:2], q[:2]), color="tab:blue", lw=1.5)
top.set(aspect="equal", title="from above: at home (grey), at the pose", xlabel="x [m]", ylabel="y [m]")
heights = np.linspace(-0.3, 0.3, 61)
curve.plot(heights, [ves.leg_lengths(platform, [0, 0, z, 0, 0, 0]) for z in heights], color="tab:blue")
curve.plot(heights, [ves.leg_lengths(platform, [z, 0, 0, 0, 0, 0]) for z in heights], color="tab:orange", lw=1)
curve.set(title="legs over z (all six alike) and over x", xlabel="[m]", ylabel="length [m]")
plt.show()

# %% [markdown]
# ## From the lengths to the pose
#
# Nobody can solve the six equations for the pose in closed form; six lengths may have up to 40 poses. Newton's
# method finds the one near a guess. Equation (2.22) takes the squares, which are smoother:
#
# $$ f_i(\mathbf x) = \left|\mathbf d_i\right|^2 - L_i^2 = 0, \qquad
#    \mathbf x \leftarrow \mathbf x - \left(\frac{\partial f}{\partial \mathbf x}\right)^{-1} f \qquad (2.23) $$
#
# Here is a Newton's method with a Jacobian by differences. Watch the error: the number of right digits doubles.

# %%
def newton(lengths, steps=6, h=1e-6):
    x, left = np.zeros(6), []
    for _ in range(steps):
        f = ves.leg_lengths(platform, x)**2 - lengths**2
        left.append(np.abs(f).max())
        J = np.column_stack([(ves.leg_lengths(platform, x + h * e)**2 - ves.leg_lengths(platform, x - h * e)**2)
                             / (2 * h) for e in np.eye(6)])
        x = x - np.linalg.solve(J, f)
    return x, left

found, left = newton(lengths)
for i, value in enumerate(left):
    print(f"step {i}: {value:.1e} m^2 off")
assert np.allclose(found, pose, atol=1e-9)
assert np.allclose(ves.forward_pose(platform, lengths), pose, atol=1e-9)

# %% [markdown]
# `ves.forward_pose` does the same with the exact Jacobian, in about a microsecond, a hundred times a second while
# the machine moves. It steps by a twist instead of by angles; the next lesson is about that.
#
# ## Exercise
#
# The legs of this machine end at 1.85 m. How high can the platform rise from home, straight up? Give the answer in
# metres, in closed form.

# %% answer
# Straight up every leg keeps its horizontal distance d, so L^2 = d^2 + (h + z)^2.
d = np.linalg.norm((P - B)[0, :2])
z = np.sqrt(1.85**2 - d**2) - h
print(f"{z:.4f} m")
assert abs(ves.leg_lengths(platform, [0, 0, z, 0, 0, 0]).max() - 1.85) < 1e-9
