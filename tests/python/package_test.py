# SPDX-License-Identifier: BSD-3-Clause
"""The Python package `ves`: the laws its functions keep, the programs' numbers, and its refusals."""
import argparse
import copy
import csv
import inspect
import os
import pathlib
import pickle
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import ves

ROOT = pathlib.Path(__file__).resolve().parents[2]
options = argparse.Namespace()
random = np.random.default_rng(1)
WORKSPACE = np.array([0.3, 0.3, 0.3, 0.5, 0.5, 0.5])


def command(*arguments):
    done = subprocess.run([str(options.build / "apps/ves"), *map(str, arguments)], text=True, capture_output=True,
                          env=dict(os.environ, VES_CONFIG_DIR=str(ROOT / "config")))
    assert done.returncode == 0, done.stderr
    return done.stdout


def about(axis, angle):
    """Rodrigues."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def exponential(A):
    """By its series, after halving."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(), 1e-9)))) + 4)
    A, term, total = A / 2**halvings, np.eye(len(A)), np.eye(len(A))
    for k in range(1, 25):
        term = term @ A / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


class Frames(unittest.TestCase):
    def test_rotation_is_three_turns_about_fixed_axes(self):
        for a in random.uniform(-1.4, 1.4, (50, 3)):
            R = about((0, 0, 1), a[2]) @ about((0, 1, 0), a[1]) @ about((1, 0, 0), a[0])
            np.testing.assert_allclose(ves.rotation(a), R, atol=1e-14)
            np.testing.assert_allclose(ves.fixed_angles(R), a, atol=1e-12)

    def test_rates_of_angles_become_an_angular_velocity(self):
        h = 1e-6
        for a, rate in zip(random.uniform(-1.4, 1.4, (20, 3)), random.uniform(-1, 1, (20, 3))):
            W = (ves.rotation(a + h * rate) - ves.rotation(a - h * rate)) / (2 * h) @ ves.rotation(a).T
            np.testing.assert_allclose(ves.angle_rate_map(a) @ rate, [W[2, 1], W[0, 2], W[1, 0]], atol=1e-8)


class Kinematics(unittest.TestCase):
    def setUp(self):
        self.platform = ves.load_platform("z_sine")

    def test_lengths_are_distances_between_joints(self):
        p = self.platform
        for x in random.uniform(-1, 1, (50, 6)) * WORKSPACE:
            ends = x[:3] + [0, 0, p.home_height] + p.platform_joints @ ves.rotation(x[3:]).T
            np.testing.assert_allclose(ves.leg_lengths(p, x), np.linalg.norm(ends - p.base_joints, axis=1), atol=1e-13)

    def test_forward_finds_what_inverse_came_from(self):
        for platform in (self.platform, ves.load_platform("desk"), ves.load_platform("hall")):
            size = np.linalg.norm(platform.platform_joints[0]) / 0.55
            for x in random.uniform(-0.6, 0.6, (50, 6)) * WORKSPACE * ([size] * 3 + [1] * 3):
                found = ves.forward_pose(platform, ves.leg_lengths(platform, x))
                np.testing.assert_allclose(found, x, atol=1e-7)

    def test_motion_of_legs_is_the_derivative_of_lengths_and_back(self):
        h = 1e-5
        for x, v, a in random.uniform(-0.5, 0.5, (20, 3, 6)) * WORKSPACE:
            at = lambda t: ves.leg_lengths(self.platform, x + v * t + 0.5 * a * t * t)
            L, rate, acceleration = ves.leg_motion(self.platform, x, v, a)
            np.testing.assert_allclose(L, at(0), atol=1e-14)
            np.testing.assert_allclose(rate, (at(h) - at(-h)) / (2 * h), atol=1e-8)
            np.testing.assert_allclose(acceleration, (at(h) - 2 * at(0) + at(-h)) / h**2, atol=1e-4)
            twist, change = ves.forward_motion(self.platform, x, rate, acceleration)
            np.testing.assert_allclose(twist[:3], v[:3], atol=1e-10)
            np.testing.assert_allclose(twist[3:], ves.angle_rate_map(x[3:]) @ v[3:], atol=1e-10)
            np.testing.assert_allclose(change[:3], a[:3], atol=1e-9)
            E = lambda t: ves.angle_rate_map(x[3:] + v[3:] * t) @ (v[3:] + a[3:] * t)
            np.testing.assert_allclose(change[3:], (E(h) - E(-h)) / (2 * h), atol=1e-8)

    def test_condition_is_of_the_jacobian(self):
        p, h = self.platform, 1e-6
        J = np.column_stack([(ves.leg_lengths(p, h * e) - ves.leg_lengths(p, -h * e)) / (2 * h) for e in np.eye(6)])
        J[:, 3:] /= 0.55
        self.assertAlmostEqual(ves.condition_number(p, np.zeros(6)),
                               np.linalg.norm(J) * np.linalg.norm(np.linalg.inv(J)) / 6, places=6)

    def test_a_platform_may_be_written_out(self):
        p = self.platform
        same = ves.Platform(p.base_joints, p.platform_joints, p.home_height)
        np.testing.assert_array_equal(ves.leg_lengths(same, 0.1 * np.ones(6)), ves.leg_lengths(p, 0.1 * np.ones(6)))


class Robots(unittest.TestCase):
    def setUp(self):
        self.robot = ves.load_robot("puma560")
        self.q = random.uniform(-1, 1, 6)
        self.zero = np.zeros(6)

    def test_a_locked_robot_is_one_rigid_body(self):
        m, c, I = ves.composite_body(self.robot, self.q)
        w, alpha, a = random.uniform(-1, 1, (3, 3))
        wrench, _ = ves.newton_euler(self.robot, self.q, self.zero, self.zero, w, alpha, a)
        force = m * (a + np.cross(alpha, c) + np.cross(w, np.cross(w, c)))
        np.testing.assert_allclose(wrench[:3], force, atol=1e-9)
        np.testing.assert_allclose(wrench[3:], I @ alpha + np.cross(w, I @ w) + np.cross(c, force), atol=1e-9)

    def test_weight_is_what_holds_it_up_against_gravity(self):
        R = ves.rotation([0.2, -0.3, 0.4])
        up = R.T @ [0, 0, 9.81]
        held, _ = ves.newton_euler(self.robot, self.q, self.zero, self.zero, a=up)
        np.testing.assert_allclose(ves.gravity_wrench(self.robot, self.q, R), -held, atol=1e-9)

    def test_efforts_do_the_work_that_the_energy_takes(self):
        q, q_dot, q_ddot = random.uniform(-1, 1, (3, 6))
        _, efforts = ves.newton_euler(self.robot, q, q_dot, q_ddot, a=(0, 0, 0))
        # tau = M q_ddot + h(q, q_dot): M symmetric and positive, and power = dT/dt.
        column = lambda q, e: ves.newton_euler(self.robot, q, self.zero, e, a=(0, 0, 0))[1]
        M = lambda q: np.column_stack([column(q, e) for e in np.eye(6)])
        np.testing.assert_allclose(M(q), M(q).T, atol=1e-9)
        self.assertGreater(np.linalg.eigvalsh(M(q))[0], 0)
        h = 1e-5
        T = lambda t: 0.5 * (q_dot + q_ddot * t) @ M(q + q_dot * t + 0.5 * q_ddot * t * t) @ (q_dot + q_ddot * t)
        self.assertAlmostEqual(efforts @ q_dot, (T(h) - T(-h)) / (2 * h), places=5)

    def test_links_turn_about_their_joints(self):
        poses = ves.link_poses(self.robot, self.q)
        self.assertEqual(poses.shape, (6, 4, 4))
        for X in poses:
            np.testing.assert_allclose(X[:3, :3].T @ X[:3, :3], np.eye(3), atol=1e-12)
            np.testing.assert_array_equal(X[3], [0, 0, 0, 1])
        other = self.q + [0, 0, 0.7, 0, 0, 0]
        moved = ves.link_poses(self.robot, other)
        np.testing.assert_array_equal(poses[:2], moved[:2])
        turn = poses[2][:3, :3].T @ moved[2][:3, :3]
        self.assertAlmostEqual(np.arccos((np.trace(turn) - 1) / 2), 0.7)

    def test_names_and_joints_are_those_of_the_description(self):
        self.assertEqual(self.robot.joint_names, [f"joint_{i}" for i in range(1, 7)])
        np.testing.assert_allclose(np.degrees(self.robot.joints), [0, -90, 90, 0, 0, 0])


class Bases(unittest.TestCase):
    def test_a_step_is_the_exponential(self):
        base = ves.load_base("srms_low_hover")
        k, dt = len(base.stiffness), 0.3
        A = np.block([[np.zeros((k, k)), np.eye(k)], [-np.diag(base.stiffness), -base.damping]])
        W = np.array([3.0, -2, 1, 0.5, 2, -1])
        B = np.concatenate([np.zeros(k), base.shapes.T @ W])
        whole = exponential(np.block([[A, B[:, None]], [np.zeros((1, 2 * k + 1))]]) * dt)
        y = random.uniform(-0.1, 0.1, 2 * k)
        eta, eta_dot = ves.admittance_step(base, y[:k], y[k:], W, dt)
        np.testing.assert_allclose(np.concatenate([eta, eta_dot]), whole[:-1, :-1] @ y + whole[:-1, -1], atol=1e-10)

    def test_modes_solve_their_eigenproblem(self):
        M, K = np.diag([500.0] * 3 + [250.0] * 3), np.diag([1500.0, 2500, 4000, 1500, 1000, 2000])
        M[0, 4] = M[4, 0] = 60.0
        base = ves.modes(M, 0.1 * K, K)
        np.testing.assert_allclose(base.shapes.T @ M @ base.shapes, np.eye(6), atol=1e-10)
        np.testing.assert_allclose(base.shapes.T @ K @ base.shapes, np.diag(base.stiffness), atol=1e-8)
        np.testing.assert_allclose(base.damping, np.diag(0.1 * base.stiffness), atol=1e-8)
        np.testing.assert_allclose(base.frequencies, np.sqrt(base.stiffness) / (2 * np.pi))

    def test_hold_is_the_exponential(self):
        Phi, Gamma = ves.second_order_hold(40.0, 1.3, 0.2)
        whole = exponential(np.array([[0, 1, 0], [-40.0, -1.3, 1], [0, 0, 0]]) * 0.2)
        np.testing.assert_allclose(Phi, whole[:2, :2], atol=1e-13)
        np.testing.assert_allclose(Gamma, whole[:2, 2], atol=1e-13)


class Stability(unittest.TestCase):
    def test_the_third_root_of_an_undamped_oscillator_is_the_mass_ratio(self):
        for ratio in (0.3, 0.9, 1.2):
            self.assertAlmostEqual(ves.appendix_e_roots(ratio, 1e5, 0.0)[2], -ratio, places=4)

    def test_loop_is_what_the_command_prints(self):
        printed = command("stability", "loop", "srms_capture_doss")
        mode = len(ves.load_base("srms_capture").stiffness)
        row = next(l for l in printed.splitlines() if l.split()[:1] == [str(mode)])
        for direction, word in (("extending", 3), ("retracting", 7)):
            growth = float(row.split()[word])
            self.assertAlmostEqual(ves.loop_root("srms_capture_doss", direction=direction)["growth"], growth, places=3)
        margins = ves.loop_margins("srms_capture_doss")
        self.assertTrue(margins["stable"])
        bears = [float(l.split("bears ")[1].split(" %")[0].replace("at least ", ""))
                 for l in printed.splitlines() if "bears" in l]
        self.assertAlmostEqual(100 * margins["inertia"], min(bears), delta=0.51)

    def test_a_loop_that_diverges_says_why(self):
        light = {"base.mass_diagonal": [5] * 3 + [2] * 3}
        margins = ves.loop_margins("puma_on_table_4_1", light)
        self.assertFalse(margins["stable"])
        self.assertIn("would diverge", margins["why"])
        self.assertGreater(ves.loop_root("puma_on_table_4_1", light)["growth"], 0)
        with self.assertRaisesRegex(ves.InputError, "forced"):
            ves.run("puma_on_table_4_1", light)


class Experiments(unittest.TestCase):
    def test_a_run_is_what_the_command_writes(self):
        with tempfile.TemporaryDirectory() as folder:
            command("run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--seed", 5, "--out", folder + "/a")
            with open(folder + "/a/series.csv") as file:
                rows = list(csv.DictReader(file))
        run = ves.run("puma_on_table_4_1", seed=5)
        self.assertEqual(run.phase, "parked")
        for name in ("t_s", "z_actual_m", "beta_commanded_rad", "fx_dynamic_n"):
            np.testing.assert_allclose(run[name], [float(r[name]) for r in rows], rtol=1e-6, atol=1e-9)
        np.testing.assert_array_equal(run.pose("actual")[:, 2], run["z_actual_m"])

    def test_the_free_base_is_what_the_command_writes(self):
        with tempfile.TemporaryDirectory() as folder:
            command("srms", "simulate", "srms_capture_doss", "--out", folder + "/a.csv")
            with open(folder + "/a.csv") as file:
                rows = list(csv.DictReader(file))
        for model in ("whole", "split"):
            t, x = ves.simulate_base("srms_capture_doss", model=model)
            np.testing.assert_allclose(t, [float(r["t_s"]) for r in rows], atol=1e-6)
            np.testing.assert_allclose(x[:, 0], [float(r[f"x_{model}_m"]) for r in rows], rtol=1e-6, atol=1e-12)

    def test_settings_are_what_the_command_sets(self):
        run = ves.run("z_sine", {"sensor.noise": False, "program": [{"move": {}}], "legs.tau_s": np.float64(0.01)})
        self.assertEqual(run.phase, "parked")
        self.assertLess(len(run["t_s"]), 400)

    def test_a_stopped_run_names_its_check(self):
        button = {"at_s": 0.5, "duration_s": 9, "fault": "panic_button"}
        run = ves.run("z_sine", {"program": [{"move": {"duration_s": 3}, "faults": [button]}]})
        self.assertEqual((run.phase, run.cause), ("stopped", "panic button"))


class Refusals(unittest.TestCase):
    def refused(self, error, says, call):
        with self.assertRaises(error) as raised:
            call()
        text = str(raised.exception)
        self.assertIn(says, text)
        self.assertNotIn("\n", text)

    def test_every_one_in_one_line(self):
        p, r, b = ves.load_platform("z_sine"), ves.load_robot("puma560"), ves.load_base("table_4_1")
        z = np.zeros(6)
        for error, says, call in (
                (ValueError, "pose: has shape (5,), want (6,)", lambda: ves.leg_lengths(p, np.zeros(5))),
                (ValueError, "pose: has shape (1, 1, 6)", lambda: ves.leg_lengths(p, np.zeros((1, 1, 6)))),
                (ValueError, "pose[1][2]: nan", lambda: ves.leg_lengths(p, [z, [0, 0, np.nan, 0, 0, 0]])),
                (ValueError, "batches of 2, 3 do not go together",
                 lambda: ves.leg_motion(p, np.zeros((2, 6)), np.zeros((3, 6)), z)),
                (TypeError, "is a masked array", lambda: ves.leg_lengths(p, np.ma.array(z, mask=z == 0))),
                (TypeError, "holds complex128", lambda: ves.leg_lengths(p, z + 1j)),
                (TypeError, "holds object", lambda: ves.leg_lengths(p, z.astype(object))),
                (TypeError, "holds <U1", lambda: ves.leg_lengths(p, ["0"] * 6)),
                (TypeError, "a masked array", lambda: ves.run("z_sine", {"sensor.gain": np.ma.array(z)})),
                (ValueError, "lengths[2]: nan, want finite", lambda: ves.forward_pose(p, [1, 1, np.nan, 1, 1, 1])),
                (ValueError, "guess[0]: inf", lambda: ves.forward_pose(p, [1.5] * 6, [np.inf, 0, 0, 0, 0, 0])),
                (TypeError, "pose: holds <U4, want real numbers", lambda: ves.leg_lengths(p, "home")),
                (TypeError, "pose: want numbers", lambda: ves.leg_lengths(p, [[1, 2], [3]])),
                (TypeError, "platform: is of type Robot, want Platform", lambda: ves.leg_lengths(r, z)),
                (TypeError, "robot: is of type Platform, want Robot", lambda: ves.link_poses(p, z)),
                (TypeError, "base: is of type NoneType", lambda: ves.admittance_step(None, z, z, z, 0.1)),
                (ValueError, "q: has shape (3,), want (6,)", lambda: ves.newton_euler(r, [0] * 3, z, z)),
                (ValueError, "eta: has shape (2,), want (6,)", lambda: ves.admittance_step(b, [0, 0], z, z, 0.1)),
                (ValueError, "dt: nan", lambda: ves.second_order_hold(1, 1, np.nan)),
                (ValueError, "damping_ratio: 1.0", lambda: ves.appendix_e_roots(1, 10, 1.0)),
                (ValueError, "R: is 1 from orthogonal", lambda: ves.fixed_angles(np.zeros((3, 3)))),
                (ValueError, "or a reflection", lambda: ves.fixed_angles(-np.eye(3))),
                (ValueError, "mass: is not positive definite", lambda: ves.modes(np.zeros((6, 6)), np.eye(6), np.eye(6))),
                (ValueError, "stiffness: is not symmetric", lambda: ves.modes(np.eye(6), np.eye(6), np.triu(np.ones((6, 6))))),
                (ves.InputError, "lengths: no pose found near the guess", lambda: ves.forward_pose(p, [0.1] * 5 + [3])),
                (ves.InputError, "scenario 'nope': unknown, want one of", lambda: ves.run("nope")),
                (ves.InputError, "platform 'nope': unknown, want one of desk, hall", lambda: ves.load_platform("nope")),
                (ves.InputError, "robot 'nope': unknown, want one of", lambda: ves.load_robot("nope")),
                (ves.InputError, "no such file", lambda: ves.load_robot("/no/such.urdf")),
                (ves.InputError, "legs.tau_s: 'nan'", lambda: ves.run("z_sine", {"legs.tau_s": np.nan})),
                (ves.InputError, "leg 1 is 1.5277 m at home", lambda: ves.load_platform("z_sine", {"safety.leg_max_m": 1.5})),
                (ValueError, "seed: -1.0", lambda: ves.run("z_sine", seed=-1)),
                (ValueError, "direction: 'up', want one of", lambda: ves.loop_root("z_sine", direction="up")),
                (KeyError, "want one of t_s", lambda: ves.Run({"t_s": z}, "", "")["t"])):
            with self.subTest(says):
                self.refused(error, says, call)


class Arrays(unittest.TestCase):
    def test_a_batch_is_what_its_members_are(self):
        p, r, b = ves.load_platform("z_sine"), ves.load_robot("puma560"), ves.load_base("table_4_1")
        X, Q = random.uniform(-0.2, 0.2, (5, 6)), random.uniform(-1, 1, (5, 6))
        for function, arguments in (
                (ves.rotation, (X[:, 3:],)), (ves.fixed_angles, (ves.rotation(X[:, 3:]),)),
                (ves.angle_rate_map, (X[:, 3:],)), (lambda x: ves.leg_lengths(p, x), (X,)),
                (lambda x: ves.jacobian(p, x), (X,)), (lambda x: ves.condition_number(p, x), (X,)),
                (lambda *x: ves.leg_motion(p, *x), (X, Q, Q)), (lambda *x: ves.forward_motion(p, *x), (X, Q, Q)),
                (lambda x: ves.forward_pose(p, x), (ves.leg_lengths(p, X),)), (lambda q: ves.link_poses(r, q), (Q,)),
                (lambda *q: ves.newton_euler(r, *q), (Q, Q, Q)), (lambda q: ves.composite_body(r, q), (Q,)),
                (lambda q: ves.gravity_wrench(r, q), (Q,)), (lambda *e: ves.admittance_step(b, *e, 0.1), (Q, Q, X))):
            whole = function(*arguments)
            for k in range(5):
                one = function(*(a[k] for a in arguments))
                for w, o in zip(whole, one) if isinstance(whole, tuple) else ((whole, one),):
                    np.testing.assert_array_equal(w[k], o)

    def test_the_jacobian_leads_from_twists_to_leg_rates(self):
        p = ves.load_platform("z_sine")
        for x, rates in zip(random.uniform(-0.2, 0.2, (10, 6)), random.uniform(-1, 1, (10, 6))):
            twist = np.concatenate([rates[:3], ves.angle_rate_map(x[3:]) @ rates[3:]])
            legs = (ves.leg_lengths(p, x + 1e-6 * rates) - ves.leg_lengths(p, x - 1e-6 * rates)) / 2e-6
            np.testing.assert_allclose(ves.jacobian(p, x) @ twist, legs, atol=1e-8)

    def test_numbers_of_numpy_are_numbers(self):
        p = ves.load_platform("desk")
        x = np.float32([0, 0, 0.01, 0, 0, 0])
        np.testing.assert_array_equal(ves.leg_lengths(p, x), ves.leg_lengths(p, x.astype(float)))
        short = {"program": "[{move: {}}]", "sensor.noise": np.bool_(False), "seed": np.int64(3),
                 "gravity_m_per_s2": np.array(9.5)}
        self.assertEqual(ves.run("z_sine", short).phase, "parked")

    def test_everything_can_be_pickled_and_copied(self):
        p, r, b = ves.load_platform("desk"), ves.load_robot("puma560"), ves.load_base("table_4_1")
        run = ves.run("z_sine", {"program": "[{move: {}}]"})
        q = random.uniform(-1, 1, (3, 6))
        for again in (lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy):
            np.testing.assert_array_equal(ves.leg_lengths(again(p), 1e-3 * q), ves.leg_lengths(p, 1e-3 * q))
            for ours, theirs in zip(ves.newton_euler(again(r), q, q, q), ves.newton_euler(r, q, q, q)):
                np.testing.assert_array_equal(ours, theirs)
            np.testing.assert_array_equal(again(b).damping, b.damping)
            np.testing.assert_array_equal(again(run).pose(), run.pose())
        self.assertEqual(len(run.plot().axes), 2)

    def test_settings_are_what_the_commands_take(self):
        self.assertEqual(ves._settings({"a": [1, True, np.float32(0.5)], "b": {"c": np.array([1.5, 2]), "d": (1,)},
                                        "e": np.bool_(False), "f": "x", "g": np.int64(7)}),
                         ["a=[1, true, 0.5]", "b={c: [1.5, 2.0], d: [1]}", "e=false", "f=x", "g=7"])

    def test_a_robot_stands_on_earth_where_nothing_else_is_said(self):
        r, q = ves.load_robot("puma560"), random.uniform(-1, 1, 6)
        for ours, theirs in zip(ves.newton_euler(r, q, q, q),
                                ves.newton_euler(r, q, q, q, [0, 0, 0], [0, 0, 0], [0, 0, 9.81])):
            np.testing.assert_array_equal(ours, theirs)

    def test_a_stiffness_that_pushes_away_is_refused(self):
        one = np.eye(6)
        self.assertEqual(len(ves.modes(one, 0 * one, 0 * one).stiffness), 6)  # afloat
        K = one.copy()
        K[0, 1] = K[1, 0] = 1.1  # eigenvalues 2.1 and -0.1
        with self.assertRaisesRegex(ValueError, "stiffness: has a negative eigenvalue"):
            ves.modes(one, 0 * one, K)

    def test_what_is_taken_ends_at_its_limits(self):
        r, b, z = ves.load_robot("puma560"), ves.load_base("table_4_1"), np.zeros(6)
        joints = ves.load_platform("desk").base_joints
        for low, high, call in ((0, 1e3, lambda x: ves.gravity_wrench(r, z, gravity=x)),
                                (1e-6, 1e6, lambda x: ves.Platform(joints, joints, x)),
                                (-1e3, 1e3, lambda x: ves.admittance_step(b, z, z, z, x)),
                                (0, 1e12, lambda x: ves.second_order_hold(x, 0, 0)),
                                (0, 1e9, lambda x: ves.second_order_hold(1, x, 0)),
                                (0, 1e3, lambda x: ves.second_order_hold(1, 1, x)),
                                (0, 1e6, lambda x: ves.appendix_e_roots(x, 100, 0.1)),
                                (2, 1e9, lambda x: ves.appendix_e_roots(1, x, 0.1)),
                                (0, 0.999999, lambda x: ves.appendix_e_roots(1, 100, x)),
                                (0, 2**32 - 1, lambda x: ves.run("z_sine", {"program": "[{move: {}}]"}, x))):
            call(low), call(high)
            for beyond in np.nextafter(low, -np.inf), np.nextafter(high, np.inf):
                with self.assertRaisesRegex(ValueError, "want a number in"):
                    call(beyond)

    def test_a_plot_is_of_the_run_in_mm_and_degrees(self):
        run = ves.run("z_sine", {"program": "[{move: {to: {z_m: 0.05, beta_deg: 0.2}}}]"})
        figure = run.plot("measured")
        self.assertEqual([a.get_ylabel() for a in figure.axes], ["position [mm]", "angle [deg]"])
        self.assertEqual(figure.axes[1].get_xlabel(), "time [s]")
        for axes, first, names, scale in zip(figure.axes, (0, 3), ("xyz", ("alpha", "beta", "gamma")), (1e3, 180 / np.pi)):
            self.assertEqual([t.get_text() for t in axes.get_legend().get_texts()], list(names))
            self.assertEqual(len(axes.lines), 6)
            for k, line in enumerate(axes.lines):
                which = "commanded" if k % 2 else "measured"
                np.testing.assert_array_equal(line.get_xdata(), run["t_s"])
                np.testing.assert_allclose(line.get_ydata(), scale * run.pose(which)[:, first + k // 2])
        low, high = figure.axes[1].get_ylim()  # a fifth of a degree is not blown up
        self.assertAlmostEqual(high - low, 1.0)
        self.assertTrue(low < 0.0 and high > 0.2)
        low, high = figure.axes[0].get_ylim()
        self.assertTrue(-10 < low < 0 and 50 < high < 60)
        with self.assertRaisesRegex(ValueError, "which: 'true', want one of actual, commanded, measured"):
            run.pose("true")
        ticks = len(run["t_s"])
        self.assertEqual([repr(x) for x in (run, ves.Run(run.columns, "stopped", "pressure"), ves.load_platform("z_sine"),
                                            ves.load_robot("puma560"), ves.load_base("table_4_1"))],
                         [f"<ves.Run, {ticks} ticks, parked>", f"<ves.Run, {ticks} ticks, stopped by pressure>",
                          f"<ves.Platform, home at {ves.load_platform('z_sine').home_height:g} m>",
                          "<ves.Robot, 6 joints>", "<ves.Base, 6 modes>"])

    def test_another_numpy_is_refused_before_it_ends_the_process(self):
        done = subprocess.run([sys.executable, "-c", "import numpy; numpy.__version__ = '2.1.0'; import ves"],
                              text=True, capture_output=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("ImportError: ves was built for NumPy 1, this is NumPy 2.1.0", done.stderr)


class Help(unittest.TestCase):
    def test_every_public_function_says_what_goes_in_and_comes_out(self):
        public = [f for n, f in vars(ves).items()
                  if inspect.isfunction(f) and not n.startswith("_") and f.__module__ == "ves"]
        self.assertGreaterEqual(len(public), 20)
        for f in public:
            text = inspect.getdoc(f) or ""
            self.assertTrue(text.splitlines() and text.splitlines()[0].endswith((".", ")", ":")), f.__name__)
            for name, parameter in inspect.signature(f).parameters.items():
                self.assertIsNot(parameter.annotation, inspect.Parameter.empty, f"{f.__name__}.{name}")
            self.assertIsNot(inspect.signature(f).return_annotation, inspect.Signature.empty, f.__name__)

    def test_messages_are_here_too(self):
        state = ves.state_t()
        state.header.sequence = 7
        self.assertEqual(ves.state_t.decode(state.encode()).header.sequence, 7)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    _, rest = parser.parse_known_args(namespace=options)
    unittest.main(argv=[sys.argv[0], *rest])
