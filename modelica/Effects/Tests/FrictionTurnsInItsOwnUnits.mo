within Effects.Tests;
model FrictionTurnsInItsOwnUnits "A flywheel runs down with viscous and stops with dry friction"
  parameter Real J(unit="kg.m2") = 0.5 "Inertia";
  Real w1(unit="rad/s", start=10.0, fixed=true) "Angular velocity, viscous";
  Real w2(unit="rad/s", start=10.0, fixed=true) "Angular velocity, dry";
  RotationalFriction.Viscous viscous(v=w1, load=0.0, damping=0.25);
  RotationalFriction.Dry dry(v=w2, load=0.0, coulomb=2.5);
equation
  J*der(w1) = -viscous.f;
  J*der(w2) = -dry.f;
  assert(abs(w1 - 10.0*exp(-0.5*time)) < 1e-4, "Not an exponential run-down");
  assert(abs(w2 - max(0.0, 10.0 - 5.0*time)) < 0.01, "Not a straight run-down to standstill");
  annotation (experiment(StopTime=3.0, Tolerance=1e-8));
end FrictionTurnsInItsOwnUnits;
