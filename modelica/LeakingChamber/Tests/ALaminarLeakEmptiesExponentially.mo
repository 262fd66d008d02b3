within LeakingChamber.Tests;
model ALaminarLeakEmptiesExponentially "By 1/e within V/(R*T*conductance)"
  parameter Real c(unit="kg/(s.Pa)") = 1e-11;
  Chamber leaking(dconductance=0.0, redeclare Effects.LaminarLeak leak(conductance=c));
  Chamber corrected(dconductance=c);
  Chamber nearly(
    dconductance=0.0, redeclare Effects.LaminarLeak leak(conductance=c),
    redeclare Effects.ExpansionCooling heat(share=1.0, tau=0.1));
protected
  Real tau(unit="s") "Time constant";
equation
  tau = leaking.V/(287.05*293.15*c);
  assert(
    abs(leaking.p - 7e5*exp(-time/tau)) < 1.0, "Does not fall by 1/e in its time constant");
  assert(abs(corrected.p - leaking.p) < 1e-3, "The correction is no laminar leak");
  assert(abs(nearly.p - leaking.p) < 300.0, "Good exchange of heat is not isothermal");
  annotation (experiment(StopTime=200.0, Tolerance=1e-9));
end ALaminarLeakEmptiesExponentially;
