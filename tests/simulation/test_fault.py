"""Faults of actuators in mid-run, against closed forms of a mass that a constant force moves."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation.conditions import find_condition

MASS = 2.0  # kg
SLIDE = f"""<mujoco model="mass"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom size=".1" mass="{MASS}" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="slide" ctrlrange="-50 50"/></actuator></mujoco>"""


@smc.law_function(gains={"rate": 3.0})
def ramp(y, gains, memory):
    """A force that grows with time, held between samples."""
    return gains.rate * y.t, y.e


def ran(fault, law=ramp, **fields):
    plant = smc.plant_from(SLIDE, ["slide"])
    return smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            duration=1.0,
            fault=fault,
            **fields,
        )
    )


def impulse(t, at, gain, bias, stuck, period):
    """Integral of the faulty force up to each sample, N s, in sums over short steps."""
    h = period / 400.0
    times = (np.arange(round(t[-1] / h)) + 0.5) * h
    commanded = 3.0 * np.floor(times / period + 1e-9) * period
    last = 3.0 * np.floor((at - 1e-9) / period) * period
    force = np.where(times < at, commanded, last if stuck else gain * commanded + bias)
    total = np.concatenate([[0.0], np.cumsum(force) * h])
    return total[np.round(t / h).astype(int)]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("gain", "bias", "stuck"),
    [(0.5, 0.0, False), (0.0, 0.0, False), (1.0, -0.7, False), (0.4, 1.1, False), (1, 0, True)],
)
@pytest.mark.parametrize("at", [0.0, 0.5, 0.3125], ids=["start", "at a sample", "between"])
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_the_speed_is_the_integral_of_the_faulty_force(gain, bias, stuck, at, integrator):
    fault = smc.Fault(
        at=at,
        gain=gain,
        bias=bias,
        stuck=stuck,
    )
    trace = ran(
        fault,
        control_period=5e-3,
        physics_step=2.5e-4,
        integrator=integrator,
    )
    expected = impulse(trace.t, at, gain, bias, stuck, 5e-3) / MASS
    if not (stuck and at == 0.0):  # nothing was told before
        assert np.allclose(
            trace.v[:, 0],
            expected,
            rtol=0.0,
            atol=2e-5,
        )
    assert np.allclose(trace.u[:, 0], 3.0 * trace.t)  # the law does not know


@pytest.mark.parametrize("gain", [0.5, 0.2])
def test_behind_a_lag_the_force_follows_the_faulty_command(gain):
    trace = ran(smc.Fault(at=0.5, gain=gain), actuator=smc.Lag(0.02))
    late = trace.t >= 0.7
    lagged = gain * 3.0 * (trace.t[late] - 0.02)
    assert np.allclose(trace.force[late, 0], lagged, atol=0.01)


TWO = SLIDE.replace("</body>", "</body>" + SLIDE[SLIDE.index("<body>") : SLIDE.index("</world")], 1)
TWO = TWO.replace('"slide"', '"left"', 1).replace('joint name="slide"', 'joint name="right"')
TWO = TWO.replace('<motor joint="slide"', '<motor joint="left"/><motor joint="right"')


@pytest.mark.parametrize("fields", [{"gain": 0.5}, {"bias": -0.7}, {"stuck": True}], ids=str)
@pytest.mark.parametrize("on", ["left", "right"])
@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_a_fault_on_one_motor_leaves_the_other_as_it_is(fields, on, lag, tmp_path):
    plant = smc.plant_from(TWO, ["left", "right"])
    run = {"plant": plant, "law": ramp, "duration": 1.0, "actuator": [smc.Lag(lag)] if lag else []}
    faults = smc.Fault(at=0.5, **fields, on=on), smc.Fault(at=0.5, **fields)
    on_one, on_all, none = smc.run([smc.Scenario(fault=fault, **run) for fault in (*faults, None)])
    i = ["left", "right"].index(on)
    assert np.array_equal(on_one.v[:, i], on_all.v[:, i])
    assert np.array_equal(on_one.v[:, 1 - i], none.v[:, 1 - i])
    assert not np.array_equal(on_one.v, none.v)
    text = str(smc.condition("f", fault=faults[0]))
    assert find_condition(text).on(plant, 1.0) == {"fault": on_one.scenario.fault}
    assert on in faults[0].words


def test_a_rotor_that_loses_half_of_its_thrust_tips_its_own_corner():
    model = smc.plant("quadrotor").load()
    flight = {"plant": "quadrotor", "law": "geometric", "duration": 0.05}
    runs = [smc.Scenario(**flight)]
    corners = []
    for i in range(1, 5):
        runs.append(smc.Scenario(**flight, fault=smc.Fault(at=0.0, gain=0.5, on=f"rotor{i}")))
        corners.append(model.site(f"rotor{i}").pos[:2])
    none, *traces = smc.run(runs)
    for (x, y), trace in zip(corners, traces, strict=True):
        # less thrust at (x, y): a torque about (-y, x)
        assert np.array_equal(np.sign(trace.x[-1, 3:5] - none.x[-1, 3:5]), np.sign((-y, x)))
    with pytest.raises(smc.ScenarioError, match=r"rotor9.*rotor"):
        smc.Scenario(plant="quadrotor", law="geometric", fault=smc.Fault(at=0.0, on="rotor9"))


@pytest.mark.parametrize(("duration", "at"), [(10.0, 2.0), (3.0, 2.0), (1.0, 0.5)])
def test_the_condition_takes_half_the_force_at_two_seconds(duration, at):
    (run,) = smc.grid("duffing", "pid", "fault", duration=duration)
    assert run.fault == smc.Fault(at=at, gain=0.5)


def test_a_fault_is_kept_told_and_part_of_a_condition(tmp_path):
    fault = smc.Fault(at=0.5, gain=0.5)
    trace = ran(fault)
    assert smc.load(trace.save(tmp_path / "a.npz")).scenario.fault == fault
    named = smc.condition("half", fault=fault)
    assert (
        smc.run(
            smc.grid(
                "duffing",
                "pid",
                [named],
                duration=1.0,
            )
        )[0].scenario.fault
        == fault
    )
    titles = []
    for ax in smc.figure(trace).axes:
        titles += [text.get_text() for text in ax.texts]
    assert any("0.5" in title for title in titles)


@pytest.mark.parametrize("kp", [15.0, 40.0])
@pytest.mark.parametrize("x0", [0.5, 0.8])
def test_the_gain_that_may_be_lost_is_what_holds_the_start(kp, x0):
    @smc.law_function(gains={"kp": 15.0, "kd": 5.0})
    def pd(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    weight = 0.5 * 9.81 * 0.5
    margins = smc.margins(
        "inverted_pendulum",
        pd(kp=kp),
        "loss",
        starts=smc.starts(x0=x0),
    )
    held = 1.0 - weight * np.sin(x0) / 6.0  # u_max is 6 N m
    assert margins[0].value == pytest.approx(held, abs=0.03)


LIFTS = """<mujoco model="lifts"><option><flag contact="disable"/></option><worldbody>
<body><joint name="one" type="slide" axis="0 0 1"/><geom size=".1" mass="1"/></body>
<body><joint name="three" type="slide" axis="0 0 1"/><geom size=".1" mass="3"/></body>
</worldbody></mujoco>"""


def test_the_margin_of_gain_is_of_all_actuators_or_of_the_one_that_a_fault_names():
    channel = smc.Channel(motor=True, u_max=50.0, x0=0.3)
    plant = smc.plant_from(LIFTS, {"one": channel, "three": channel})
    law = smc.law("pid", kp=90.0, ki=200.0, kd=40.0)
    margins = []
    for on in (None, "three", "one"):
        loss = smc.condition("loss", fault=smc.Fault(at=0.0, on=on))
        margins += smc.margins(plant, law, "loss", quick=True, threads=1, condition=loss)
    of_all, heavy, light = [margin.value for margin in margins]
    assert of_all == heavy < 1.0 - 3.0 * 9.81 / 50.0 < light < 1.0 - 9.81 / 50.0


@pytest.mark.parametrize(
    "fields",
    [{"at": -1.0}, {"at": 0.1, "gain": np.nan}, {"at": 0.1, "stuck": True, "gain": 0.5}],
)
def test_faults_that_make_no_sense_are_refused(fields):
    with pytest.raises(smc.ScenarioError, match="Fault"):
        smc.Fault(**fields)


def test_a_fault_after_the_end_is_refused():
    with pytest.raises(smc.ScenarioError, match="earlier"):
        ran(smc.Fault(at=3.0))
