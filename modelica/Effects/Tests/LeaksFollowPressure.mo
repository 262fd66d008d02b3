within Effects.Tests;
model LeaksFollowPressure "Laminar leaks: linear, quadratic for a gas; a chamber empties by them"
  parameter Real c(unit="kg/(s.Pa)") = 1e-9 "Conductance";
  parameter Real capacity(unit="kg/Pa") = 1e-8 "Of the chamber";
  Units.Pressure p(start=4e5, fixed=true, nominal=1e5) "In a chamber that leaks to 1 bar";
  Leaks.Laminar laminar(p1=p, p2=1e5, conductance=c);
  Leaks.CompressibleLaminar gas(p1=p, p2=1e5, conductance=c);
  Leaks.CompressibleLaminar back(p1=1e5, p2=p, conductance=c);
  Leaks.Steady steady(p1=p, p2=1e5, rate=2e-4);
equation
  capacity*der(p) = -laminar.q;
  assert(abs(p - 1e5 - 3e5*exp(-0.1*time)) < 1.0, "The overpressure does not fall by 1/e in 10 s");
  assert(abs(gas.q - laminar.q*(p + 1e5)/2e5) < 1e-12, "Not proportional to the mean pressure");
  assert(abs(gas.q + back.q) <= 0.0, "Not the same in the other direction");
  assert(abs(steady.q - 2e-4) <= 0.0, "Not steady");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end LeaksFollowPressure;
