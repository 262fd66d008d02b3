within WheelsetRig.Tests;
model WheelLocksAndSpinsUp "A wheel locks when demand exceeds adhesion and spins up when released"
  parameter Units.Velocity v = 20.0 "Speed at the start";
  Reference rig(
    muWR=0.10, pB=2.1e5*(tanh(4.0*(time - 1.0)) - tanh(4.0*(time - 4.0))), dmuWR=0.0, dmuDC=0.0,
    tauR=(1.0 - rig.JR/7840.0)*(rig.rR*rig.Fx + rig.rollerLoss.tau),
    omegaW(start=v/rig.rW), omegaR(start=v/rig.rR));
equation
  // A locked wheel creeps within the width omega0 = 0.05 rad/s of the smoothed friction.
  assert(time < 3.0 or time > 3.5 or abs(rig.omegaW) < 0.05, "The wheel does not lock");
  assert(time < 3.0 or rig.omegaR*rig.rR > 0.5*v, "The roller stops with the wheel");
  // Rolling leaves only the slip of bearing friction, 2e-5; 1e-3 is far from any slide.
  assert(time < 6.0 or abs(rig.slip) < 1e-3*rig.rR*rig.omegaR, "The wheel does not spin up");
  annotation (experiment(StopTime=6.5, Tolerance=1e-7));
end WheelLocksAndSpinsUp;
