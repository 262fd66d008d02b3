within AirSupply.Tests;
model DeliveryFallsWithPressure "Delivery is nominal at the usual pressure, and falls on a line"
  Real p(unit="Pa") = 1.01e6*(1.0 + 0.01*time);
  Effects.FallingEfficiency compressor(nominal=0.01, p=p, runs=1.0, fall=2.0);
equation
  assert(abs(compressor.actual - 0.01*(1.0 - 0.02*time)) < 1e-12, "Not on a line");
  annotation (experiment(StopTime=10.0, Tolerance=1e-6));
end DeliveryFallsWithPressure;
