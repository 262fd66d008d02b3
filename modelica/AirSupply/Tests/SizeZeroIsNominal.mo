within AirSupply.Tests;
model SizeZeroIsNominal "No effect of this library has one by default"
  Real runs(unit="1") = 0.5 + 0.5*cos(time);
  Real p(unit="Pa") = 1e6 + 2e5*sin(time);
  Effects.CheckValveLeak valve(nominal=0.01*runs, p=p, runs=runs);
  Effects.FallingEfficiency falling(nominal=0.01*runs, p=p, runs=runs);
  Effects.WarmingUp warming(nominal=0.01*runs, p=p, runs=runs);
  Effects.StartLoss start(u=runs);
  Effects.ReservoirHeat heat(isothermal=1e3*sin(time), p=p);
equation
  assert(abs(valve.actual - 0.01*runs) + abs(falling.actual - 0.01*runs)
    + abs(warming.actual - 0.01*runs) <= 0.0, "The compressor");
  assert(abs(start.y - runs) <= 0.0, "A start");
  assert(abs(heat.actual - 1e3*sin(time)) < 1e-9, "The air");
  annotation (experiment(StopTime=7.0, Tolerance=1e-6));
end SizeZeroIsNominal;
