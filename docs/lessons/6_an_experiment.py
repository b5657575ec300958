# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # 6. A whole experiment, from scenario to figure
#
# A scenario is a YAML file: the machine, a base to emulate, a robot, and what happens. Here is one that ships, the
# PUMA 560 on the six oscillators of Table 4.1, and what the report could not do: see how far the machine is from the
# base it pretends to be.

# %%
import numpy as np
import matplotlib.pyplot as plt
import ves

print((ves.config_folder() / "scenarios/puma_on_table_4_1.yaml").read_text())

# %% [markdown]
# ## Run it
#
# `ves.run` is `./ves run --lockstep` in this process: controller and simulated machine, tick by tick, the same bits for
# the same seed. It returns the columns of series.csv.

# %%
space = {"gravity_m_per_s2": 0, "sensor.readings_per_tick": 10}
published = ves.run("puma_on_table_4_1", space, seed=1)
print(published)
assert published.phase == "parked"

# %% [markdown]
# ## What should have happened
#
# In free space robot and base obey Chapter 3, without platform, sensor or samples. Equation (3.11) splits the wrench;
# `model="whole"` solves Newton-Euler on the moving base instead, with nothing left out:
#
# $$ \left[1 + \Phi^T M_1 \Phi\right] \ddot{\boldsymbol\eta} + D\,\dot{\boldsymbol\eta} + \Omega^2\boldsymbol\eta
#    = \Phi^T \mathbf W_{\text{robot}} $$
#
# `ves.simulate_base` lets the base begin at rest at home. The scenario begins 50 mm and 4 degrees aside, to show the
# free swing; so move home instead, and compare what the robot causes.

# %%
def beside_truth(settings):
    """Times from the start of admittance control, what the platform did, what the base would have done."""
    run = ves.run("puma_on_table_4_1", settings)
    admittance = run["segment"] == 3
    t = run["t_s"][admittance] - run["t_s"][admittance][0]
    t_free, free = ves.simulate_base("puma_on_table_4_1", settings)
    free = np.column_stack([np.interp(t, t_free, column) for column in free.T])
    return t, run.pose("actual")[admittance], free

program = ("[{move: {}}, {calibration: {}}, {move: {}}, {admittance: {duration_s: 14}, robot: ["
           "{at_s: 5, duration_s: 1.05, joint: joint_2, to_deg_or_m: -30}, "
           "{at_s: 8, duration_s: 1.2, joint: joint_1, to_deg_or_m: 60}, "
           "{at_s: 11, duration_s: 1.05, joint: joint_2, to_deg_or_m: -90}]}]")
compensation = {f"controller.compensation.{part}": True for part in ("feed_forward", "observer", "inertia")}
figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
error = {}
for axis, (name, more) in zip(axes, (("as published", {}), ("compensated", compensation))):
    settings = {**space, "sensor.noise": False, "program": program, **more}
    t, x, free = beside_truth(settings)
    off = x - free
    error[name] = np.sqrt(np.mean(off[:, 0]**2)) / np.abs(free[:, 0]).max()
    axis.plot(t, 1e3 * free[:, 0], color="0.7", lw=4, label="base in free space")
    axis.plot(t, 1e3 * x[:, 0], color="tab:blue", lw=1.2, label="platform")
    axis.set(title=f"{name}: {100 * error[name]:.2f} % rms", xlabel="time [s]")
axes[0].set_ylabel("x [mm]"); axes[0].legend()
plt.tight_layout(); plt.show()
for name, value in error.items():
    print(f"{name:13s} x wrong by {100 * value:.2f} % of its peak, rms")
assert error["compensated"] < 0.2 * error["as published"]

# %% [markdown]
# ## Exercise
#
# Is it the noise? Run the compensated experiment with the sensor's noise on, with two seeds. Are the runs the same? Is
# each the same as itself, bit for bit?

# %% answer
noisy = {**space, "program": program, **compensation}
a, again, b = (ves.run("puma_on_table_4_1", noisy, seed=s)["x_actual_m"] for s in (1, 1, 2))
print("largest difference: one seed {:.1e} m, two seeds {:.1e} m".format(np.abs(a - again).max(), np.abs(a - b).max()))
assert np.array_equal(a, again) and not np.array_equal(a, b)
