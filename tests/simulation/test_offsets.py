"""The only unsafe code: offsets are refused when wrong, and the callback touches nothing but its
own records.
"""

import ctypes
import dataclasses
import threading

import mujoco
import numpy as np
import pytest
from mujoco.introspect import structs

import smc_mujoco as smc
from smc_mujoco.simulation import callback

pytestmark = pytest.mark.quick

STRUCTS = {
    name: "mjModel" if name in callback.OF_MODEL else "mjData"
    for name in callback.Offsets._fields[1:]
}
SCENARIO = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.05)


@pytest.fixture(autouse=True)
def nothing_left_behind():
    # dm_control has its own warning handler
    before = mujoco.get_mjcb_control(), mujoco.get_mju_user_warning()
    mujoco.set_mjcb_control(None)
    mujoco.set_mju_user_warning(None)
    yield
    installed = mujoco.get_mjcb_control(), mujoco.get_mju_user_warning()
    mujoco.set_mjcb_control(before[0])
    mujoco.set_mju_user_warning(before[1])
    assert installed == (None, None)


@pytest.fixture
def live():
    # none of the arrays is empty
    model = mujoco.MjModel.from_xml_string(callback.PROBE_MODEL.replace("12345", "17"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def doctored(monkeypatch, name, change):
    """Let introspection report other fields of a struct."""
    struct = structs.STRUCTS[name]
    fields = tuple(change(list(struct.fields)))
    monkeypatch.setitem(structs.STRUCTS, name, dataclasses.replace(struct, fields=fields))


def position(fields, name):
    return [field.name for field in fields].index(name)


def test_offsets_are_where_the_live_arrays_are(live):
    model, data = live
    offsets = callback.checked_offsets(model, data)
    assert offsets == callback.offsets()
    assert ctypes.c_int64.from_address(model._address + offsets.nuserdata).value == 17
    for name, struct in STRUCTS.items():
        owner = model if struct == "mjModel" else data
        assert (
            ctypes.c_void_p.from_address(owner._address + getattr(offsets, name)).value
            == getattr(owner, name).ctypes.data
        )


@pytest.mark.parametrize("name", STRUCTS)
def test_an_array_at_another_s_place_is_refused(monkeypatch, live, name):
    neighbour = {"mjModel": "dof_damping", "mjData": "qacc_warmstart"}[STRUCTS[name]]

    def swap(fields):
        here = position(fields, name)
        place = position(fields, neighbour)
        fields[here], fields[place] = fields[place], fields[here]
        return fields

    doctored(monkeypatch, STRUCTS[name], swap)
    with pytest.raises(
        callback.LayoutError, match=rf"does not have {STRUCTS[name]}\.{name} at byte"
    ):
        callback.checked_offsets(*live)


def test_a_shifted_model_is_refused(monkeypatch, live):
    def insert(fields):
        return [dataclasses.replace(fields[0], name="extra"), *fields]

    doctored(monkeypatch, "mjModel", insert)
    with pytest.raises(callback.LayoutError, match="nuserdata"):
        callback.checked_offsets(*live)


def test_nothing_is_installed_when_the_layout_is_wrong(monkeypatch):
    doctored(
        monkeypatch,
        "mjModel",
        lambda fields: [dataclasses.replace(fields[0], name="extra"), *fields],
    )
    callback.offsets.cache_clear()
    callback.callback.cache_clear()
    with pytest.raises(callback.LayoutError), callback.installed():
        pass
    assert mujoco.get_mjcb_control() is None
    monkeypatch.undo()
    assert smc.run(SCENARIO).failure is None


def counting():
    """A native control callback that counts its calls, and the list that holds the count."""
    calls = [0]

    def count(model, data):
        calls[0] += 1

    return ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(count), calls


def test_the_callback_before_is_back_after_the_block_and_after_an_exception(live):
    before, calls = counting()
    callback.callback()  # compiled by now, with the little model that checks the layout
    mujoco.set_mjcb_control(before)
    with callback.installed():
        mujoco.mj_forward(*live)
    assert calls == [0]
    with pytest.raises(KeyboardInterrupt), callback.installed():
        raise KeyboardInterrupt
    mujoco.mj_forward(*live)
    assert calls == [1]
    mujoco.set_mjcb_control(None)


def test_a_second_thread_waits_for_the_first():
    entered = threading.Event()

    def work():
        with callback.installed():
            entered.set()

    worker = threading.Thread(target=work)
    with callback.installed():
        worker.start()
        assert not entered.wait(0.1)
    worker.join(10)
    assert entered.is_set()


def userdata(kind, size):
    """What a stranger may keep in userdata."""
    rng = np.random.default_rng(size)
    return {
        "zeros": np.zeros(size),
        "ones": np.ones(size),
        "numbers": rng.normal(size=size) * 1e6,
        "nan": np.full(size, np.nan),
        "nearly our magic number": np.full(size, callback.MAGIC + 1),
    }[kind]


@pytest.mark.parametrize(
    ("size", "kind"),
    [
        (0, "zeros"),
        (1, "nearly our magic number"),
        (callback.USERDATA, "nearly our magic number"),
        (callback.USERDATA, "ones"),
        (500, "numbers"),
        (500, "nan"),
    ],
)
def test_strangers_are_not_touched(size, kind):
    model = smc.plant("pendulum_network").load(nuserdata=size)
    ends = []
    for inside in (False, True):
        data = mujoco.MjData(model)
        data.qpos[:], data.userdata[:], data.ctrl[:], data.xfrc_applied[:] = (
            0.3,
            userdata(kind, size),
            0.2,
            0.01,
        )
        if inside:
            with callback.installed():
                mujoco.mj_step(model, data, 20)
        else:
            mujoco.mj_step(model, data, 20)
        np.testing.assert_array_equal(data.userdata, userdata(kind, size))
        assert np.all(data.ctrl == 0.2)
        assert np.all(data.xfrc_applied == 0.01)
        ends.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(*ends)


def test_userdata_without_an_address_is_never_read_as_ours():
    """Even if it begins with our magic number."""
    model = smc.plant("duffing").load(nuserdata=callback.USERDATA - 1)
    data = mujoco.MjData(model)
    data.userdata[0] = callback.MAGIC
    before = data.userdata.copy()
    with callback.installed():
        mujoco.mj_step(model, data)
    np.testing.assert_array_equal(data.userdata, before)


def test_the_mujoco_whose_solver_is_wrong_is_named_at_the_first_run(monkeypatch):
    monkeypatch.setattr(mujoco, "__version__", callback.WRONG_MUJOCO)
    callback.offsets.cache_clear()
    with pytest.warns(smc.errors.ScenarioWarning, match=r"MuJoCo 4\.0\.0 solves .* wrongly"):
        callback.offsets()
    callback.offsets()
