within AirSupply.Tests;
model WarmAirCools "Compression warms the air, whose excess pressure decays"
  Effects.ReservoirHeat warms(isothermal=1000.0, p=1e6, share=0.4, tau=4.0);
  Effects.ReservoirHeat cools(isothermal=0.0, p=1e6, share=0.4, tau=4.0, excess(start=2000.0));
  Real rise(unit="Pa", start=0.0, fixed=true, nominal=1e3) "Of the pressure while air is pressed in";
  Real fall(unit="Pa", start=0.0, fixed=true, nominal=1e3) "Of the pressure afterwards";
equation
  der(rise) = warms.actual;
  der(fall) = -cools.actual;
  assert(abs(rise - 1000.0*time - 1600.0*(1.0 - exp(-time/4.0))) < 0.1, "Not warmed as said");
  assert(abs(fall - 2000.0*(1.0 - exp(-time/4.0))) < 0.1, "It does not cool as said");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end WarmAirCools;
