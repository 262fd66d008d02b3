within CascadedTanks.Tests;
model OutletsRunAsTheirHeads "A head adds to the level, a laminar part to the flow"
  parameter Real rise(unit="V/s") = 1.0;
  Real h(unit="V") = 1.0 + rise*time;
  Effects.LowerOutletHead head(nominal=0.2*Functions.root(h), h=h, k=0.2, head=3.0);
  Effects.LowerLaminarOutlet laminar(nominal=0.2*Functions.root(h), h=h, k=0.2, rate=0.01);
equation
  // 1e-5: roots are off by (h0/(2*h))^2 of themselves, at 1 V.
  assert(abs(head.actual - 0.2*sqrt(h + 3.0)) < 1e-5, "Not as a level that is higher");
  assert(abs(laminar.actual - 0.2*sqrt(h) - 0.01*h) < 1e-5, "Not in proportion");
  annotation (experiment(StopTime=9.0, Tolerance=1e-6));
end OutletsRunAsTheirHeads;
