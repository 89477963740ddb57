"""Tensors by MuJoCo's own toolbox, ``mujoco.sysid``: its parameters, residual, optimizer and covariance.

It is used as its documentation has it: residuals are divided by the root mean square of their column.

- A payload: ``InertiaType.Pseudo`` for the ten parameters, ``SignalTransform.bias`` for the sensor's offsets. The
  rollout is a custom one, MuJoCo's inverse dynamics along the joints: a log without torques drives no simulation.
- A body on a moving platform with an IMU: the same, in the platform's own axes, where gravity and its acceleration
  together are the specific force.
- A thrown body: its rollout by the measured moment, compared with its gyro. Unknown are the six parameters of the
  pseudo-inertia that turn the body, and in each run the angular velocity at the start.
"""

from collections.abc import Sequence
from io import StringIO
from typing import Any

import mujoco
import numpy as np
from mujoco import sysid

from identify.motion.serial_arm.joint_series import JointStates
from identify.rigid_body.inertia import Body, unpack
from identify.signals.run import Run
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.mujoco_model import add_payload, loaded_spec

LARGEST_OFFSET = {"force": 20.0, "torque": 2.0}
"""Bounds of the sensor's offsets [N, N·m]."""
STEP = 5e-6
"""Of the differences that turn the covariance of its parameters into that of mass, first moment and tensor."""
PLATFORM = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="platform">
      <freejoint name="free"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""
FREE_BODY = """
<mujoco>
  <option gravity="0 0 0" integrator="RK4"/>
  <worldbody>
    <body name="body">
      <freejoint name="free"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.002 0.002 0.002"/>
      <site name="gyro"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="x" joint="free" gear="0 0 0 1 0 0"/>
    <motor name="y" joint="free" gear="0 0 0 0 1 0"/>
    <motor name="z" joint="free" gear="0 0 0 0 0 1"/>
  </actuator>
  <sensor><gyro name="gyro" site="gyro"/></sensor>
</mujoco>
"""
AVAILABLE = hasattr(sysid, "optimize")
"""``mujoco.sysid`` imports as an empty module where its packages are missing."""
INSTALL = "mujoco.sysid is left out, its packages are missing: pip install 'mujoco-core[sysid]'"


def payload_by_sysid(
    arm: Arm, nominal: Body, gravity: float, t: np.ndarray, joints: JointStates, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mass, first moment and tensor about Q (xx xy xz yy yz zz), and their covariance.

    Args:
        arm: with its URDF.
        nominal: payload of the model; the optimizer starts there.
        gravity: local gravity [m/s²].
        t: instants [s], shape (t,).
        joints: angles, speeds and accelerations, (t, n) each.
        wrench: force and torque as the sensor reads them, (t, 6) [N, N·m].
    """
    spec = loaded_spec(arm, nominal, gravity)
    model = spec.compile()
    in_order = np.argsort([model.joint(name).dofadr[0] for name in arm.names])
    return _carried(spec, t, JointStates(*(values[:, in_order] for values in joints)), wrench)


def body_by_sysid(
    nominal: Body, t: np.ndarray, omega: np.ndarray, alpha: np.ndarray, specific_force: np.ndarray, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mass, first moment and tensor about Q (xx xy xz yy yz zz), and their covariance, on a moving platform.

    Args:
        nominal: the body as stated; the optimizer starts there.
        t: instants [s], shape (t,).
        omega: angular velocity, in the body's axes, (t, 3) [rad/s].
        alpha: angular acceleration, (t, 3) [rad/s²].
        specific_force: acceleration of Q less gravity, in the same axes, (t, 3) [m/s²].
        wrench: force and moment on the body about Q, (t, 6) [N, N·m].
    """
    spec = mujoco.MjSpec.from_string(PLATFORM)
    add_payload(spec.body("platform"), spec, nominal)
    rest = np.zeros((len(t), 7)) + [0, 0, 0, 1, 0, 0, 0]
    still = np.zeros((len(t), 3))
    states = JointStates(rest, np.hstack([still, omega]), np.hstack([specific_force, alpha]))
    return _carried(spec, t, states, wrench)


def _carried(spec: Any, t: np.ndarray, states: JointStates, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ten parameters of the body "payload" and their covariance, from what moves it, by inverse dynamics."""
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model = spec.compile()
    parameters, transform = sysid.ParameterDict(), sysid.SignalTransform()
    pseudo = {"inertia_type": sysid.InertiaType.Pseudo, "modifier": _with_inertia}
    parameters.add(sysid.body_inertia_param(spec, model, "payload", **pseudo))
    for name, largest in LARGEST_OFFSET.items():
        bias = sysid.Parameter(f"{name}_bias", np.zeros(3), -largest * np.ones(3), largest * np.ones(3))
        parameters.add(bias)
        transform.bias(name, bias, target="predicted")
    transform.enable_sensors(list(LARGEST_OFFSET))  # without it, 4.0.0 raises for sensors of three columns
    sequences = sysid.ModelSequences(
        "body", spec, "run",
        sysid.create_initial_state(model, states.position[0], states.speed[0]),
        sysid.TimeSeries(t, np.zeros((len(t), 0))),
        sysid.TimeSeries.from_names(t, wrench, model),
    )  # fmt: skip
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        modify_residual=transform.apply,
        custom_rollout=lambda **given: [inverse_dynamics(model, t, states) for model in given["models"]],
        resample_true=False,
    )
    return _optimum(parameters, residual, lambda x: _ten(x[:10]), 10)


def _optimum(parameters: Any, residual: Any, wanted: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """What is wanted of the first so many parameters at the optimum, and its covariance."""
    optimum, result = sysid.optimize(
        initial_params=parameters, residual_fn=residual, verbose=False, x_scale="jac", output=StringIO()
    )
    residuals, _, _ = residual(result.x, optimum)
    covariance, _ = sysid.calculate_intervals(residuals, result.jac)
    shifts = STEP * np.eye(count, len(result.x))
    slope = np.stack([wanted(result.x + shift) - wanted(result.x - shift) for shift in shifts], axis=1) / (2 * STEP)
    return wanted(result.x), slope @ covariance[:count, :count] @ slope.T


def thrown_by_sysid(runs: Sequence[Run], nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the tensor about the centre of gravity (xx xy xz yy yz zz) of a body in free flight, and its covariance.

    Args:
        runs: moment on the body and angular velocity, both in its axes.
        nominal: tensor where the optimizer starts, (6,) [kg·m²]; from a ball's it ends in another minimum.
    """
    tensor, parameters = np.asarray(unpack(nominal)), sysid.ParameterDict()
    pseudo = sysid.model_modifier.pseudoinertia_from_pi(np.concatenate([[1.0], np.zeros(3), tensor.ravel()]))
    shape = sysid.model_modifier.theta_from_pseudoinertia(pseudo)[1:7]
    parameters.add(sysid.Parameter("inertia", shape, shape - 0.5, shape + 0.5, modifier=_with_shape))
    for number, run in enumerate(runs):
        start = run.omega[0]
        parameters.add(sysid.Parameter(f"start_{number}", start, start - 1.0, start + 1.0))
    flights = [_flight(run, f"start_{number}") for number, run in enumerate(runs)]

    def residual(x: np.ndarray, parameters: Any) -> tuple[list[np.ndarray], None, None]:
        return [part for flight in flights for part in flight(x, parameters)[0]], None, None

    return _optimum(parameters, residual, lambda x: _ten(_shape(x[:6]))[4:], 6)


def _flight(run: Run, start: str) -> Any:
    """The residual of one run; the parameter ``start`` is its first angular velocity."""
    spec = mujoco.MjSpec.from_string(FREE_BODY)
    spec.option.timestep = 1 / run.rate
    model = spec.compile()

    def rollout(param_dicts: Sequence[Any], initial_states: Sequence[np.ndarray], **given: Any) -> Any:
        states = [
            sysid.create_initial_state(model, model.qpos0, np.concatenate([np.zeros(3), each[start].value]))
            for each in param_dicts
        ]
        return sysid.sysid_rollout(initial_states=states, **given)

    # a rollout's sensors tell the begin of a step, and its control is held over the step: the mean of the next one
    after = np.pad(run.moment, ((0, 2), (0, 0)), mode="edge")[1:]
    sequences = sysid.ModelSequences(
        "body", spec, run.name,
        sysid.create_initial_state(model, model.qpos0, np.zeros(6)),
        sysid.TimeSeries.from_control_names(run.t, (after[:-1] + after[1:]) / 2, model),
        sysid.TimeSeries.from_names(run.t, run.omega, model),
    )  # fmt: skip
    return sysid.build_residual_fn(models_sequences=[sequences], custom_rollout=rollout, resample_true=False)


def inverse_dynamics(model: Any, t: np.ndarray, states: JointStates) -> Any:
    """Return what the sensors of a model read along its joints, as a trajectory of ``mujoco.sysid``."""
    data, read = mujoco.MjData(model), np.empty((len(t), model.nsensordata))
    qpos, qvel, qacc, sensordata = data.qpos, data.qvel, data.qacc, data.sensordata
    for row, position, speed, acceleration in zip(read, *states, strict=True):
        qpos[:], qvel[:], qacc[:] = position, speed, acceleration
        mujoco.mj_inverse(model, data)
        row[:] = sensordata
    state = np.column_stack([t, states.position, states.speed])
    return sysid.SystemTrajectory(
        model=model,
        control=sysid.TimeSeries(t, np.zeros((len(t), 0))),
        sensordata=sysid.TimeSeries(t, read, sysid.TimeSeries.compute_all_sensor_mapping(model)),
        initial_state=state[0],
        state=sysid.TimeSeries(t, state),
    )


def _with_inertia(spec: Any, parameter: Any) -> None:
    sysid.apply_body_inertia(spec, "payload", parameter)
    spec.body("payload").iquat = [1, 0, 0, 0]  # 4.0.0 leaves NaN here, of which its compiler makes a tensor of zero


def _with_shape(spec: Any, parameter: Any) -> None:
    sysid.model_modifier.apply_body_theta_inertia(spec, "body", _shape(parameter.value))
    spec.body("body").iquat = [1, 0, 0, 0]


def _shape(six: np.ndarray) -> np.ndarray:
    """Stretches and shears as the ten parameters of a body of 1 kg about its centre of gravity."""
    return np.concatenate([[0.0], six, np.zeros(3)])


def _ten(theta: Sequence[float]) -> np.ndarray:
    """Mass, first moment and tensor of the pseudo-inertia's parameters."""
    pi = sysid.model_modifier.pi_from_theta(theta)
    return np.concatenate([pi[:4], pi[4:].reshape(3, 3)[np.triu_indices(3)]])
