# SPDX-License-Identifier: BSD-3-Clause
"""The Vehicle Emulation System's kinematics, dynamics and stability, on NumPy arrays.

Everything is SI: m, rad, s, kg, N, N m. Frames and notation are those of include/ves/math/frames.hpp:
I inertial, P the platform's top plate, L0 the robot's base link; R_IP turns the coordinates of P into
those of I. A pose is {x, y, z, alpha, beta, gamma} of P counted from home: a displacement and X-Y-Z fixed
angles. A wrench is {fx, fy, fz, mx, my, mz}. Equation numbers are those of NASA-CR-195076.

    >>> import ves
    >>> platform = ves.load_platform("desk")
    >>> lengths = ves.leg_lengths(platform, [0, 0, 0.01, 0, 0, 0])
    >>> ves.forward_pose(platform, lengths)

What is wrong with an argument is told in one line: TypeError for something that holds no numbers,
ValueError for a shape or a value, and ves.InputError, a ValueError, for files and names.

The messages of the bus are here too, by their names: ves.state_t, ves.sample_t and so on.
"""
from __future__ import annotations  # readable in help()

import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import _core

# What an older pybind11 compiled ends the process there.
if int(np.__version__.split(".")[0]) > 1 and not _core.takes_numpy_2:
    raise ImportError(f"ves was built for NumPy 1, this is NumPy {np.__version__}: use Debian's python3, "
                      "or pip install 'numpy<2'")

from ._core import InputError
from .experiment_t import experiment_t
from .header_t import header_t
from .leg_command_t import leg_command_t
from .operator_t import operator_t
from .query_t import query_t
from .robot_command_t import robot_command_t
from .sample_t import sample_t
from .setup_t import setup_t
from .state_t import state_t
from .timing_t import timing_t
from .truth_t import truth_t

__version__ = _core.version
InputError.__module__ = __name__


# --- arguments ----------------------------------------------------------------------------------------

def _array(name: str, value, shape: tuple) -> np.ndarray:
    """Finite real numbers of this shape. What would lose something on the way to them is refused."""
    out = _numbers(name, value, shape)
    if out.shape != shape:
        raise ValueError(f"{name}: has shape {out.shape}, want {shape}")
    if not np.isfinite(out).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(out))[0])
        raise ValueError(f"{name}{list(at) if at else ''}: {out[at]}, want finite numbers")
    return out


def _numbers(name: str, value, shape: tuple) -> np.ndarray:
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(f"{name}: is a masked array, want plain numbers (.filled(), .compressed())")
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "iuf":
            raise TypeError(f"{name}: holds {raw.dtype}, want real numbers of shape {shape}")
        return raw.astype(float)
    except ValueError:  # of lists of several lengths
        raise TypeError(f"{name}: want numbers of shape {shape}") from None


def _over(function, *arguments):
    """function(arrays) of `arguments`, each (name, value, shape). A leading axis more makes it a batch: the
    results are stacked along it, and arguments without it serve for all."""
    arrays = [_numbers(name, value, shape) for name, value, shape in arguments]
    sizes = {len(a) for a, (_, _, shape) in zip(arrays, arguments) if a.ndim == len(shape) + 1}
    if not sizes:
        return function(*(_array(*argument) for argument in arguments))
    if len(sizes) > 1:
        raise ValueError(f"{arguments[0][0]}: batches of {', '.join(map(str, sorted(sizes)))} do not go together")
    def one(k):
        return function(*(_array(f"{name}[{k}]" if a.ndim > len(shape) else name, a[k] if a.ndim > len(shape) else a,
                                 shape)
                          for a, (name, _, shape) in zip(arrays, arguments)))
    results = [one(k) for k in range(sizes.pop())]
    if results and isinstance(results[0], tuple):
        return tuple(np.array(part) for part in zip(*results))
    return np.array(results)


def _number(name: str, value, low: float, high: float) -> float:
    number = float(_array(name, value, ()))
    if not low <= number <= high:
        raise ValueError(f"{name}: {number}, want a number in [{low}, {high}]")
    return number


def _one_of(name: str, value, kind: type):
    if not isinstance(value, kind):
        raise TypeError(f"{name}: is of type {type(value).__name__}, want {kind.__name__}")
    return value


def _choice(name: str, value, allowed: Sequence[str]) -> str:
    if value not in allowed:
        raise ValueError(f"{name}: {value!r}, want one of {', '.join(allowed)}")
    return value


def _settings(settings: Mapping[str, object]) -> list:
    """{"legs.tau_s": 0.01} as the commands' --set takes it; True as true, lists as they are."""
    def text(value):
        if isinstance(value, np.ma.MaskedArray):
            raise TypeError("settings: a masked array, want plain values")
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value.item()
        if isinstance(value, (bool, np.bool_)):
            return str(value).lower()
        if isinstance(value, (list, tuple, np.ndarray)):
            return "[" + ", ".join(text(v) for v in value) + "]"
        if isinstance(value, Mapping):
            return "{" + ", ".join(f"{k}: {text(v)}" for k, v in value.items()) + "}"
        return repr(float(value)) if isinstance(value, np.floating) else str(value)
    return [f"{key}={text(value)}" for key, value in (settings or {}).items()]


# --- frames -------------------------------------------------------------------------------------------

def rotation(angles: ArrayLike) -> np.ndarray:
    """R_IP of X-Y-Z fixed angles {alpha, beta, gamma} [rad]; (3,) to (3, 3), (N, 3) to (N, 3, 3).

    Rz(gamma) Ry(beta) Rx(alpha), (2.19). The page prints one sign that no rotation has.
    """
    return _over(_core.rotation, ("angles", angles, (3,)))


def fixed_angles(R: ArrayLike) -> np.ndarray:
    """The angles of (2.19) [rad] of a rotation matrix, |beta| < 90 degrees; (3, 3) to (3,), or N of them."""
    def one(R):
        off = np.abs(R.T @ R - np.eye(3)).max()
        if not (off < 1e-6 and np.linalg.det(R) > 0):
            raise ValueError(f"R: is {off:.2g} from orthogonal, or a reflection; want a rotation")
        return _core.fixed_angles(R)
    return _over(one, ("R", R, (3, 3)))


def angle_rate_map(angles: ArrayLike) -> np.ndarray:
    """E with w_IP_I = E d(angles)/dt: rates of fixed angles are no angular velocity; (3,) to (3, 3).

    The inverse of (2.27b), in inertial axes.
    """
    return _over(_core.angle_rate_map, ("angles", angles, (3,)))


# --- the Stewart platform -----------------------------------------------------------------------------

class Platform:
    """Ball joints of six legs.

    Platform(base_joints, platform_joints, home_height): (6, 3) positions of the joints in I and in P
    [m], and the height of P over I at home [m].
    """

    def __init__(self, base_joints: ArrayLike, platform_joints: ArrayLike, home_height: float):
        self._core = _core.Geometry(_array("base_joints", base_joints, (6, 3)),
                                    _array("platform_joints", platform_joints, (6, 3)),
                                    _number("home_height", home_height, 1e-6, 1e6))

    @property
    def base_joints(self) -> np.ndarray:
        """(6, 3) [m] in I."""
        return self._core.base_joints

    @property
    def platform_joints(self) -> np.ndarray:
        """(6, 3) [m] in P."""
        return self._core.platform_joints

    @property
    def home_height(self) -> float:
        """[m] z of P in I at home."""
        return self._core.home_height

    def __repr__(self) -> str:
        return f"<ves.Platform, home at {self.home_height:g} m>"


def load_platform(name: str, settings: Mapping[str, object] = None) -> Platform:
    """The platform of a file of config/platforms or config/scenarios, by name or path.

    `settings`: values that differ, {"platform.home_height_m": 1.4}. Raises InputError.
    """
    g = _core.load_platform(str(name), config_folder(), _settings(settings))
    return Platform(g.base_joints, g.platform_joints, g.home_height)


def leg_lengths(platform: Platform, pose: ArrayLike) -> np.ndarray:
    """Inverse kinematics: the six legs' lengths [m] at a pose; (6,) to (6,). (C.11), (C.12).

    Here and below N poses at once, (N, 6), give N results.
    """
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda x: _core.leg_lengths(core, x), ("pose", pose, (6,)))


def jacobian(platform: Platform, pose: ArrayLike) -> np.ndarray:
    """J with leg rates = J {v, w}, P's linear and angular velocity in I; (6,) to (6, 6). (2.24)."""
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda x: _core.jacobian(core, x), ("pose", pose, (6,)))


def leg_motion(platform: Platform, pose: ArrayLike, rates: ArrayLike,
               accelerations: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths [m], rates [m/s] and accelerations [m/s^2] of the legs, (6,) each. (2.25), (2.31).

    `rates` and `accelerations`: first and second derivatives of the pose's coordinates, (6,).
    """
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda *x: _core.leg_motion(core, *x), ("pose", pose, (6,)), ("rates", rates, (6,)),
                 ("accelerations", accelerations, (6,)))


def forward_pose(platform: Platform, lengths: ArrayLike, guess: ArrayLike = (0,) * 6) -> np.ndarray:
    """Forward kinematics: the pose (6,) at which the legs have these lengths (6,) [m].

    Newton-Raphson on (2.22), (2.23) to 1e-9 m, from `guess`, a pose; of the up to 40 poses that six
    lengths allow it finds one near the guess. Raises InputError when there is none.
    """
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda *x: _core.forward_pose(core, *x), ("lengths", lengths, (6,)), ("guess", guess, (6,)))


def forward_motion(platform: Platform, pose: ArrayLike, length_rates: ArrayLike,
                   length_accelerations: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration of P in I, {linear, angular} (6,) each, of legs that move so.

    (2.24) and (2.32), the latter with the whole of the second derivative. Raises InputError where the
    platform is singular.
    """
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda *x: _core.forward_motion(core, *x), ("pose", pose, (6,)),
                 ("length_rates", length_rates, (6,)), ("length_accelerations", length_accelerations, (6,)))


def condition_number(platform: Platform, pose: ArrayLike) -> float:
    """|J| |J^-1| / 6 of the Jacobian from twists to leg rates: 1 at best, infinite when singular.

    Lengths are counted in the radius of the platform's joints.
    """
    core = _one_of("platform", platform, Platform)._core
    return _over(lambda x: _core.condition_number(core, x), ("pose", pose, (6,)))


# --- robots -------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Robot:
    """A robot of load_robot(): a tree of links on a base link L0."""
    joint_names: list
    joints: np.ndarray  #: (n,) where they begin [rad | m]
    _core: object

    def _values(self, name: str, value) -> tuple:
        return name, value, (len(self.joint_names),)

    def __repr__(self) -> str:
        return f"<ves.Robot, {len(self.joint_names)} joints>"


def load_robot(name: str, settings: Mapping[str, object] = None) -> Robot:
    """A robot from a URDF file, or of config/robots by name or path.

    `settings`: which joints move, {"tip": LINK}, {"joints": [..]}, {"lock.JOINT": degrees or metres}.
    Raises InputError.
    """
    model, names, q = _core.load_robot(str(name), config_folder(), _settings(settings))
    return Robot(names, q, model)


def link_poses(robot: Robot, q: ArrayLike) -> np.ndarray:
    """Homogeneous poses of every link that moves, in L0; joint values (n,) to (links, 4, 4)."""
    core = _one_of("robot", robot, Robot)._core
    return _over(lambda x: np.array(_core.link_poses(core, x)), robot._values("q", q))


def newton_euler(robot: Robot, q: ArrayLike, q_dot: ArrayLike, q_ddot: ArrayLike,
                 w: ArrayLike = (0, 0, 0), alpha: ArrayLike = (0, 0, 0),
                 a: ArrayLike = (0, 0, 9.81)) -> tuple[np.ndarray, np.ndarray]:
    """Inverse dynamics on a base that moves (Appendix A): the wrench and the joints' efforts.

    q, q_dot, q_ddot: (n,) joint values and derivatives [rad | m]. The motion of L0 in its own axes:
    w [rad/s], alpha [rad/s^2], and `a` [m/s^2], the acceleration of its origin less gravity: at rest on
    Earth {0, 0, 9.81}, in space 0. Returns the wrench (6,) about L0's origin that acts on the robot from
    what it stands on, in L0, and (n,) joint efforts [N m | N].
    """
    core = _one_of("robot", robot, Robot)._core
    return _over(lambda *x: _core.newton_euler(core, *x), robot._values("q", q), robot._values("q_dot", q_dot),
                 robot._values("q_ddot", q_ddot), ("w", w, (3,)), ("alpha", alpha, (3,)), ("a", a, (3,)))


def composite_body(robot: Robot, q: ArrayLike) -> tuple[float, np.ndarray, np.ndarray]:
    """The robot with its joints locked at q (n,): mass [kg], centre (3,) [m], inertia (3, 3) [kg m^2].

    In L0; the inertia about the centre. [M_1] of (3.1).
    """
    core = _one_of("robot", robot, Robot)._core
    return _over(lambda x: _core.composite_body(core, x), robot._values("q", q))


def gravity_wrench(robot: Robot, q: ArrayLike, R_IL: ArrayLike = np.eye(3),
                   gravity: float = 9.81) -> np.ndarray:
    """What the robot's weight does about L0's origin, in L0; (6,). (B.4).

    R_IL (3, 3) turns the coordinates of L0 into those of I; gravity [m/s^2] acts along -z of I.
    """
    core, g = _one_of("robot", robot, Robot)._core, _number("gravity", gravity, 0.0, 1e3)
    return _over(lambda x, R: _core.gravity_wrench(core, x, R, g), robot._values("q", q), ("R_IL", R_IL, (3, 3)))


# --- flexible bases -----------------------------------------------------------------------------------

class Base:
    """A flexible base by its modes: eta'' + damping eta' + stiffness eta = shapes^T W, x = shapes eta."""

    def __init__(self, core):
        self._core = core

    @property
    def shapes(self) -> np.ndarray:
        """(6, k) mass-normalised shapes at the robot's foot."""
        return self._core.shapes

    @property
    def stiffness(self) -> np.ndarray:
        """(k,) [1/s^2] omega^2."""
        return self._core.stiffness

    @property
    def damping(self) -> np.ndarray:
        """(k, k) [1/s]; diagonal, 2 zeta omega, when it is proportional."""
        return self._core.damping

    @property
    def frequencies(self) -> np.ndarray:
        """(k,) [Hz], softest first."""
        return np.sqrt(self.stiffness) / (2 * np.pi)

    def __repr__(self) -> str:
        return f"<ves.Base, {len(self.stiffness)} modes>"


def load_base(name: str, settings: Mapping[str, object] = None) -> Base:
    """A base of config/bases, by name or path. Raises InputError."""
    return Base(_core.load_base(str(name), config_folder(), _settings(settings)))


def modes(mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike) -> Base:
    """The modes of M x'' + C x' + K x = W, (6, 6) each; (3.9). Damping that couples them is kept.

    M must be symmetric and positive definite, K symmetric. Raises ValueError.
    """
    M, C, K = (_array(n, v, (6, 6)) for n, v in
               (("mass", mass), ("damping", damping), ("stiffness", stiffness)))
    for name, A in (("mass", M), ("stiffness", K)):
        if np.abs(A - A.T).max() > 1e-9 * np.abs(A).max():
            raise ValueError(f"{name}: is not symmetric")
    if np.linalg.eigvalsh(M)[0] <= 0:
        raise ValueError("mass: is not positive definite")
    if np.linalg.eigvalsh(K)[0] < -1e-9 * np.abs(K).max():
        raise ValueError("stiffness: has a negative eigenvalue")
    return Base(_core.modes(M, C, K))


def admittance_step(base: Base, eta: ArrayLike, eta_dot: ArrayLike, wrench: ArrayLike,
                    dt: float) -> tuple[np.ndarray, np.ndarray]:
    """(C.6): modal coordinates and rates (k,) after dt [s] of a wrench (6,) that is held. Exact.

    The pose of the base is base.shapes @ eta. For damping of any form, coupled or not.
    """
    k = len(_one_of("base", base, Base).stiffness)
    step = _number("dt", dt, -1e3, 1e3)
    return _over(lambda *x: _core.admittance_step(base._core, *x, step), ("eta", eta, (k,)),
                 ("eta_dot", eta_dot, (k,)), ("wrench", wrench, (6,)))


def second_order_hold(stiffness: float, damping: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """(D.5): {y, y'} after dt [s] is Phi {y, y'} + Gamma u, for y'' + damping y' + stiffness y = u held.

    stiffness [1/s^2] omega^2, damping [1/s] 2 zeta omega. Phi (2, 2), Gamma (2,). Exact.
    """
    return _core.second_order_hold(_number("stiffness", stiffness, 0.0, 1e12),
                                   _number("damping", damping, 0.0, 1e9),
                                   _number("dt", dt, 0.0, 1e3))


# --- stability ----------------------------------------------------------------------------------------

def appendix_e_roots(mass_ratio: float, samples_per_period: float,
                     damping_ratio: float) -> np.ndarray:
    """Roots of (E.11), (3,) complex: the pair, then the real third. Diverges when one is above 1.

    An oscillator of mass m with a mass m_1 fed back through a sampled force sensor: mass_ratio m_1/m,
    samples a period of the oscillator, damping ratio below 1.
    """
    return _core.appendix_e_roots(_number("mass_ratio", mass_ratio, 0.0, 1e6),
                                  _number("samples_per_period", samples_per_period, 2.0, 1e9),
                                  _number("damping_ratio", damping_ratio, 0.0, 0.999999))


def loop_root(scenario: str, settings: Mapping[str, object] = None,
              direction: str = "extending") -> dict:
    """The dominant root of a scenario's whole loop: base, servos, robot, sensor, sampling.

    {"radius" a period [-], "growth" [1/s], "frequency" [Hz], "shape" (6,)}: it diverges when radius is
    above 1. `direction` of the legs: "extending", "retracting" or "swinging". Raises InputError.
    """
    return _core.loop_root(_scenario(scenario), _settings(settings),
                           _choice("direction", direction, ("extending", "retracting", "swinging")))


def loop_margins(scenario: str, settings: Mapping[str, object] = None) -> dict:
    """The gate's verdict on a scenario: {"stable", "why"}, and what a stable loop bears.

    "inertia" of the robot and "servo_gain" as factors, a wrench "early" or "late" [s], further ticks of
    "delay"; each is the least of both directions, and bounded by 64, 5 ms and 50.
    """
    return _core.loop_margins(_scenario(scenario), _settings(settings))


# --- experiments --------------------------------------------------------------------------------------

def config_folder() -> pathlib.Path:
    """Where scenarios, robots, bases and platforms are: VES_CONFIG_DIR, or those that came with this."""
    own = pathlib.Path(__file__).parent / "share/ves/config"  # of a wheel
    return pathlib.Path(os.environ.get("VES_CONFIG_DIR", own if own.exists() else _core.config))


def _scenario(name: str):
    return _core.find_scenario(str(name), config_folder())


def simulate_base(scenario: str, settings: Mapping[str, object] = None,
                  model: str = "whole") -> tuple[np.ndarray, np.ndarray]:
    """Chapter 3: the scenario's robot on its base in free space, without platform, sensor or sampling.

    Times (n,) [s] from the start of admittance control and poses (n, 6) of the base. `model`: "whole",
    Newton-Euler on the moving base, or "split", the report's (3.11). Raises InputError.
    """
    return _core.simulate_base(_scenario(scenario), _settings(settings),
                               _choice("model", model, ("whole", "split")))


@dataclass(frozen=True)
class Run:
    """What a run left: run["z_actual_m"] is a column (ticks,) of series.csv."""
    columns: dict
    phase: str  #: "parked" when all went well
    cause: str  #: the safety check that stopped it, or ""

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise KeyError(f"{name!r}, want one of {', '.join(self.columns)}")
        return self.columns[name]

    def pose(self, which: str = "actual") -> np.ndarray:
        """(ticks, 6) of the platform: "actual", "commanded" or "measured"."""
        _choice("which", which, ("actual", "commanded", "measured"))
        units = ("x", "m"), ("y", "m"), ("z", "m"), ("alpha", "rad"), ("beta", "rad"), ("gamma", "rad")
        return np.column_stack([self[f"{c}_{which}_{unit}"] for c, unit in units])

    def to_dataframe(self):
        """A pandas.DataFrame, a row a tick, by t_s. Needs pandas."""
        import pandas
        return pandas.DataFrame(self.columns).set_index("t_s")

    def plot(self, which: str = "actual"):
        """Positions [mm] and angles [deg] over time, the commanded ones dashed. Returns the
        matplotlib.figure.Figure."""
        from matplotlib.figure import Figure
        figure = Figure(figsize=(7, 5), layout="constrained")
        t, pose, commanded = self["t_s"], self.pose(which), self.pose("commanded")
        for axes, part, scale, names, label in zip(
                figure.subplots(2, 1, sharex=True), (slice(0, 3), slice(3, 6)), (1e3, 180 / np.pi),
                (("x", "y", "z"), ("alpha", "beta", "gamma")), ("position [mm]", "angle [deg]")):
            for k, name in enumerate(names):
                line, = axes.plot(t, scale * pose[:, part][:, k], label=name)
                axes.plot(t, scale * commanded[:, part][:, k], "--", color=line.get_color(), linewidth=0.8)
            low, high = axes.get_ylim()
            if high - low < 1.0:  # a millimetre, a degree: nothing moved
                axes.set_ylim((low + high) / 2 - 0.5, (low + high) / 2 + 0.5)
            axes.set_ylabel(label)
            axes.legend(loc="upper right")
            axes.grid(alpha=0.3)
        axes.set_xlabel("time [s]")
        return figure

    def __repr__(self) -> str:
        ended = self.phase + (f" by {self.cause}" if self.cause else "")
        return f"<ves.Run, {len(next(iter(self.columns.values())))} ticks, {ended}>"


def run(scenario: str, settings: Mapping[str, object] = None, seed: int = None) -> Run:
    """A scenario in lockstep, controller and simulated machine in this process: bit-identical for a seed.

    `scenario`: name in config/scenarios, or a .yaml file. `settings`: values that differ,
    {"gravity_m_per_s2": 0, "sensor.noise": False}. Raises InputError; a run that a safety check stops
    returns, with the check as its cause.
    """
    settings = dict(settings or {})
    if seed is not None:
        settings["seed"] = int(_number("seed", seed, 0, 2**32 - 1))
    return Run(*_core.run(_scenario(scenario), _settings(settings)))
