within WheelsetRig.Tests;
model LoadCellsReadCreepForce "In steady braking the load cells read the creep force, side by side"
  parameter Units.Velocity v = 30.0 "Speed at the start";
  Reference rig(
    pB=1.35e5*(1.0 + tanh(2.0*(time - 2.0))), dmuWR=0.0, dmuDC=0.0,
    tauR=rig.rR*rig.Fx + rig.rollerLoss.tau,
    omegaW(start=v/rig.rW), omegaR(start=v/rig.rR)) "Held at constant speed by the drive";
  output Real error(unit="1") = (rig.FcellL + rig.FcellR)/rig.Fx - 1.0 "Of the sum of the cells";
  output Real split(unit="1") = (rig.FcellL - rig.FcellR)/rig.Fx "Difference of the cells";
equation
  // 1e-4: what is left of the modes 4 s after first contact; the slowest decays with 10 1/s.
  assert(time < 6.0 or abs(error) < 1e-4, "Sum of the cells");
  assert(time < 6.0 or abs(split) < 1e-4, "Difference of the cells");
  // Before braking the creep force carries the wheelset's own losses.
  assert(time > 0.5 or rig.Fx < 400.0, "Creep force without brake");
  assert(time < 6.0 or rig.Fx > 14000.0, "Creep force with brake");
  annotation (experiment(StopTime=8.0, Tolerance=1e-8));
end LoadCellsReadCreepForce;
