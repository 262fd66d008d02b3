within WheelsetRig.Tests;
model PowerIsBalanced "Work of the drive is stored or turned into heat, with everything on"
  parameter Units.Velocity v = 120.0/3.6 "Speed at the start";
  parameter Units.Inertia JTrain = 7840.0 "Inertia that drive and roller imitate";
  Reference rig(
    pB=1.8e5*(1.0 + tanh(2.0*(time - 2.0))), dmuWR=0.0, dmuDC=0.0, muDCunit={1.0, 0.5, 1.2},
    tauR=(1.0 - rig.JR/JTrain)*(rig.rR*rig.Fx + rig.rollerLoss.tau),
    omegaW(start=v/rig.rW), omegaR(start=v/rig.rR));
  Units.Energy work(start=0.0, fixed=true) "Work of the drive";
  Units.Energy heat(start=0.0, fixed=true) "Energy turned into heat";
  output Units.Energy residual "Energy without origin";
  final parameter Units.Energy energy0 =
    0.5*rig.JW*(v/rig.rW)^2 + 0.5*rig.JR*(v/rig.rR)^2 + 0.8*rig.Fz*1.5*rig.Fz/1.2e9
    "Rotation, and 0.4*Q*h in the elastic contact of each wheel";
equation
  der(work) = rig.tauR*rig.omegaR;
  der(heat) = rig.lossPower;
  residual = rig.energy + heat - work - energy0;
  // 10 J of 9 MJ: 1e-6 of what is converted, 100 times the solver's tolerance.
  assert(abs(residual) < 10.0, "Power is not balanced");
  assert(rig.lossPower > -1e-6, "A damper or friction gives energy");
  annotation (experiment(StopTime=30.0, Tolerance=1e-8));
end PowerIsBalanced;
