"""The virtual rig of the train: stops by its data sheet, of which the observer model knows less.

Wheel loads shift with the forces that act, each disc has its own temperature, the rail differs
along the way and is cleaned by the wheels before, and slide protection works on each axle. Each
wheelset is stepped by the linearly implicit Euler method.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.native import compiled

AXLES, BOGIES, VEHICLES, DISCS = 8, 4, 2, 3
PLACES = np.array([0.0, 2.5, 19.0, 21.5, 26.4, 28.9, 45.4, 47.9])  # of the axles [m]
STEP = 2e-3  # [s]

_BRAKE_RADIUS, _GRAVITY = 0.300, 9.81  # m, m/s2
_WET = 0.12  # friction of a wet disc
_GRID = 5.0  # of what differs along the rail [m]
_LEAD = 100.0  # of the rail before the start [m]
_END = 6000.0  # of the rail [m]
_LONGEST = 150.0  # of a stop [s]
_REST = 2.0  # recorded after standstill [s]
_STANDSTILL = 0.05  # [m/s]


@dataclass(frozen=True)
class AskedStop:
    """A stop as it is asked for."""

    name: str  # of its folder, NN_noun
    speed: float  # at the command [m/s]
    pressure: float  # that is asked for in a full vehicle [Pa]
    rail: str  # what the crew says, dry or wet

    @property
    def number(self) -> int:
        """NN of the name."""
        return int(self.name[:2])


class Train(NamedTuple):
    """A train and its stop, as the equations read them, SI."""

    # friction, units, drag, radius, stiffness, share, inertia: (8,) of each axle
    friction: Vector
    units: Vector
    drag: Vector
    radius: Vector
    stiffness: Vector
    share: Vector
    inertia: Vector
    # target, begin, lag: (4,) pressure of each bogie, when it begins to rise, lag of its cylinders
    target: Vector
    begin: Vector
    lag: Vector
    mass: Vector  # (2,) of each vehicle
    resistance: Vector  # (3,) A, B, C
    # (6,) of the pads: speed, exponent, fade, glazing, film of water at the start, energy of a disc
    # that leaves 1/e of it [J]
    law: Vector
    polach: Vector  # (4,) kA, kS, A, B


class Way(NamedTuple):
    """The rail and the line, every 5 m from 100 m before the start."""

    mu0: Vector  # (w,) friction at zero slip, which wheels change as they clean it
    # gradient, curve: (w,) [1] true gradient, resistance of curves over weight
    gradient: Vector
    curve: Vector
    rolling: Vector  # (w,) deviation of the rolling radius [m]


@dataclass(frozen=True, eq=False)
class StopResult:
    """A stop, every STEP."""

    # time, v, s, a: (n,) [s], [m/s], [m] of the first axle, [m/s2] as an accelerometer feels it
    time: Vector
    v: Vector
    s: Vector
    a: Vector
    omega: Matrix  # (n, 8) [rad/s]
    pressure: Matrix  # (n, 4) behind the relay valves [Pa]
    # force, load: (n, 8) creep force of an axle, and load of its two wheels [N]
    force: Matrix
    load: Matrix
    standstill: float  # [s]


class _State(NamedTuple):
    """State of the equations."""

    # omega, before: (8,) speeds of the axles, and when slide protection last looked [rad/s]
    omega: Vector
    before: Vector
    # T, heat, rubbed: (8, 3) temperature of each disc [degrees C], torque of its pads [N.m], and
    # their work [J]
    T: Matrix
    heat: Matrix
    rubbed: Matrix
    supply: Vector  # (4,) pressure behind the relay valves [Pa]
    # cylinder, passed: (8,) pressure in the cylinders of an axle [Pa], and share of what its valve
    # passes on
    cylinder: Vector
    passed: Vector
    valve: Vector  # (8,) of slide protection: 1 fills, 0 holds, -1 vents
    # force, loads: (8,) creep force of an axle, load of one wheel [N]
    force: Vector
    loads: Vector


@compiled
def _at(values, s):  # type: ignore[no-untyped-def]
    """Value of the way at a place, between its points."""
    x = min(max((s + _LEAD) / _GRID, 0.0), values.size - 1.001)
    i = int(x)
    return values[i] + (x - i) * (values[i + 1] - values[i])


@compiled
def _creep(polach, mu0, stiffness, load, w, v):  # type: ignore[no-untyped-def]
    """Creep force of one wheel after Polach (2005)."""
    kA, kS, A, B = polach[0], polach[1], polach[2], polach[3]
    mu = mu0 * ((1.0 - A) * math.exp(-B * abs(w)) + A)
    K = stiffness * (load / 80e3) ** (2.0 / 3.0)
    epsilon = math.pi * K * w / (4.0 * load * mu * math.sqrt(v * v + 0.01))
    adhesion = kA * epsilon / (1.0 + (kA * epsilon) ** 2)
    return 2.0 * load * mu / math.pi * (adhesion + math.atan(kS * epsilon))


@compiled
def _clean(mu0, s, moved, energy):  # type: ignore[no-untyped-def]
    """Bring the rail under a wheel nearer to clean, by slip work [J/m] over a way moved [m]."""
    i = int((s + _LEAD) / _GRID + 0.5)
    if 0 <= i < mu0.size and mu0[i] < 0.16:
        mu0[i] += min(energy / 4e3 * moved / _GRID, 1.0) * mu0[i]
    elif 0 <= i < mu0.size and mu0[i] < 0.32:
        mu0[i] += min(energy / 4e3 * moved / _GRID, 1.0) * (0.32 - mu0[i])


@compiled
def _load(train, state, slowing):  # type: ignore[no-untyped-def]
    """Load of one wheel of each axle, which shifts with deceleration and forces."""
    for i in range(state.loads.size):
        j, first = (i // 2) % 2, i - i % 2
        m = train.mass[i // 4]
        both = state.force[first] + state.force[first + 1]
        shift = slowing * m * 1.3 / 38.0 * (1 - 2 * j) + both * 0.2 * (1 - 2 * (i % 2))
        state.loads[i] = 0.5 * (m * _GRAVITY / 4.0 * train.share[i] + shift)


@compiled
def _protect(train, state, v):  # type: ignore[no-untyped-def]
    """Slide protection: vents at 12 % slip, holds as the wheel gains speed, fills below 3 %."""
    for i in range(state.valve.size):
        slip = 1.0 - train.radius[i] * state.omega[i] / max(v, 0.1)
        if v < 2.0 or slip < 0.03:
            state.valve[i] = 1.0
        elif state.valve[i] < 1.0 and state.omega[i] > state.before[i]:
            state.valve[i] = 0.0
        elif slip > 0.12:
            state.valve[i] = -1.0
        state.before[i] = state.omega[i]


@compiled
def _press(train, state, braking):  # type: ignore[no-untyped-def]
    """Pressures behind the relay valves and in the cylinders, and share that protection passes."""
    for j in range(state.supply.size):
        target = train.target[j] if braking >= train.begin[j] else 0.0
        state.supply[j] += STEP / 0.45 * (target - state.supply[j])
    for i in range(state.cylinder.size):
        share = STEP / (train.lag[i // 2] + STEP)  # all of it without a lag
        state.cylinder[i] += share * (state.supply[i // 2] - state.cylinder[i])
        if state.valve[i] > 0.0:
            state.passed[i] += STEP / 0.45 * (1.0 - state.passed[i])
        elif state.valve[i] < 0.0:
            state.passed[i] -= STEP / 0.2 * state.passed[i]


@compiled
def _pads(train, state, i, v):  # type: ignore[no-untyped-def]
    force = 0.1086 * max(0.0, state.cylinder[i] * state.passed[i] - 25e3)
    speed, exponent, fade, glazing = train.law[0], train.law[1], train.law[2], train.law[3]
    common = train.friction[i] * (1.0 + speed * (1.0 - v / 22.0)) * force * _BRAKE_RADIUS
    common *= (max(force, 100.0) / 35e3) ** -exponent
    torque = 0.0
    for d in range(DISCS):
        T = state.T[i, d]
        glazed = 1.0 - glazing / (1.0 + math.exp(-(T - 110.0) / 6.0))
        acting = min(max(train.units[i] - d, 0.0), 1.0)
        dry = common * (1.0 - fade * (T - 60.0)) * glazed
        film = train.law[4] * math.exp(-state.rubbed[i, d] / train.law[5])
        state.heat[i, d] = acting * (dry + film * (_WET * force * _BRAKE_RADIUS - dry))
        torque += state.heat[i, d]
    return torque


@compiled
def _turn(train, way, state, i, v, s):  # type: ignore[no-untyped-def]
    """One implicit step of an axle, by its own speed; sets its creep force and heats each disc."""
    omega, r = state.omega[i], train.radius[i] + _at(way.rolling, s)
    mu0, load, K = _at(way.mu0, s), state.loads[i], train.stiffness[i]
    w, dw = v - r * omega, 1e-4
    F = 2.0 * _creep(train.polach, mu0, K, load, w, v)
    slope = (2.0 * _creep(train.polach, mu0, K, load, w + dw, v) - F) / dw
    braked = _pads(train, state, i, v) + 25.0 + 0.6 * omega + 0.004 * omega * omega + train.drag[i]
    smooth = math.tanh(omega / 0.05)
    rate = r * F - braked * smooth
    stiff = r * r * slope + braked / 0.05 * (1.0 - smooth * smooth)
    change = STEP * rate / (train.inertia[i] + STEP * stiff)
    state.omega[i] = max(omega + change, 0.0)
    state.force[i] = F - slope * r * (state.omega[i] - omega)
    for d in range(DISCS):
        T = state.T[i, d]
        cooling = 1.1 * (25.0 + 8.0 * (0.65 * v) ** 0.8) * (T - 20.0)
        state.rubbed[i, d] += STEP * state.heat[i, d] * omega
        state.T[i, d] = T + STEP / 37.5e3 * (0.93 * state.heat[i, d] * omega - cooling)
    return abs(state.force[i] * w) / max(v, 1.0)


@compiled
def _simulate(train, way, state, v, command, rows):  # type: ignore[no-untyped-def]
    """Fill rows of t, v, s, a, speeds, forces, loads, pressures; number of the last that moves.

    Rows are (n, 4 + 3*8 + 4).
    """
    s, slowing, m = 0.0, 0.0, train.mass[0] + train.mass[1]
    A, B, C = train.resistance[0], train.resistance[1], train.resistance[2]
    for k in range(rows.shape[0]):
        t = k * STEP
        _press(train, state, t - command)
        _load(train, state, slowing)
        if k % 5 == 0:
            _protect(train, state, v)
        total = 0.0
        for i in range(state.omega.size):
            energy = _turn(train, way, state, i, v, s - PLACES[i])
            _clean(way.mu0, s - PLACES[i], v * STEP, 0.5 * energy)
            total += state.force[i]
        first, second = _at(way.gradient, s - 10.75), _at(way.gradient, s - 37.15)
        hill = _GRAVITY * (train.mass[0] * first + train.mass[1] * second)
        hill += _GRAVITY * m * _at(way.curve, s - 23.95)
        rate = -(total + A + B * v + C * v * v + hill) / m
        slowing = -rate
        rows[k, 0], rows[k, 1], rows[k, 2] = t, v, s
        rows[k, 3] = rate + _GRAVITY * first
        n = state.omega.size
        for i in range(n):
            rows[k, 4 + i] = state.omega[i]
            rows[k, 4 + n + i] = state.force[i]
            rows[k, 4 + 2 * n + i] = 2.0 * state.loads[i]
        for j in range(state.supply.size):
            rows[k, 4 + 3 * n + j] = state.supply[j]
        s += STEP * (v + 0.5 * STEP * rate)
        v += STEP * rate
        if v < _STANDSTILL:
            return k
    return -1


def points() -> Vector:
    """Places of the values of a way, (w,), from the start of the first axle [m]."""
    return np.arange(-_LEAD, _END, _GRID)


def simulate(
    train: Train, way: Way, stop: AskedStop, speed: float, command: float, T: Matrix
) -> StopResult:
    """Simulate a stop.

    Parameters
    ----------
    way : its rail is cleaned by the wheels.
    speed : at the start [m/s].
    command : when to brake [s].
    T : (8, 3) temperature of each disc at the start [degrees C].

    Raises
    ------
    InputError
        If the train does not stand after 150 s.
    """
    rows = np.zeros((round(_LONGEST / STEP), 4 + 3 * AXLES + BOGIES))
    state = _State(
        omega=speed / train.radius,
        before=np.zeros(AXLES),
        T=T.copy(),
        heat=np.zeros((AXLES, DISCS)),
        rubbed=np.zeros((AXLES, DISCS)),
        supply=np.zeros(BOGIES),
        cylinder=np.zeros(AXLES),
        passed=np.ones(AXLES),
        valve=np.ones(AXLES),
        force=np.zeros(AXLES),
        loads=np.zeros(AXLES),
    )
    last = _simulate(train, way, state, speed, command, rows)
    if last < 0:
        raise InputError(
            where=stop.name,
            found=f"{rows[-1, 1]:.1f} m/s after {_LONGEST:g} s",
            expected="brakes that stop the train",
            remedy="plant smaller effects",
        )
    end = min(last + round(_REST / STEP), len(rows) - 1)
    standstill = rows[last + 1 : end]
    standstill[:, 0] = STEP * np.arange(last + 1, end)
    standstill[:, 2], standstill[:, 28:] = rows[last, 2], rows[last, 28:]
    t, v, s, a = rows[:end, :4].T
    omega, force, load, pressure = np.split(rows[:end, 4:], (8, 16, 24), axis=1)
    return StopResult(
        time=t,
        v=v,
        s=s,
        a=a,
        omega=omega,
        pressure=pressure,
        force=force,
        load=load,
        standstill=float(rows[last, 0]),
    )
