within WheelsetRig.Tests;
model FadeFollowsHeat "Friction falls as the disc heats up between friction and air"
  parameter Units.Velocity v = 14.0 "Sliding velocity";
  Effects.BrakeFade hot(level=0.30, Fperp=30000.0, v=-v, fade=1e-3);
  Effects.BrakeFade warm(level=0.30, Fperp=30000.0, v=-v, fade=1e-3, TBefore=T);
  final parameter Units.Power q = 0.93*0.30*30000.0*v "Into the disc, at nominal friction";
  final parameter Real h(unit="W/K") = 20.0 + 5.0*(v*0.46/0.30)^0.8 "Cooling";
  final parameter Real rate(unit="W/K") = h + 1e-3*q "Cooling and fade, which are linear in T";
  final parameter Units.Temperature T = (q*(1.0 + 1e-3*373.15) + h*293.15)/rate "In the end";
equation
  // 1e-4 K of 80 K: 1e-6 for the solver and for the rounded power 0.8 of the speed.
  assert(abs(hot.T - T - (333.15 - T)*exp(-rate*time/37500.0)) < 1e-4, "Temperature of the disc");
  assert(abs(hot.mu - 0.30*(1.0 - 1e-3*(hot.T - 373.15))) < 1e-12, "Friction at a temperature");
  // The rounded power takes 2e-3 K of 650 K in the end.
  assert(abs(warm.T - T) < 2e-3, "A disc that was as hot before as it gets stays so");
  assert(time < 29.0 or hot.mu < 0.30, "The disc does not get hot");
  annotation (experiment(StopTime=30.0, Tolerance=1e-10));
end FadeFollowsHeat;
