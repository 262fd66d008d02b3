within AirSupply.Tests;
model AStartCostsItsTime "What a start costs is its loss, as a time of full delivery; a back flow stops"
  Effects.StartLoss start(u=1.0, loss=5.0);
  Effects.WarmingUp warming(nominal=0.01, p=1e6, runs=1.0, share=0.2);
  Effects.CheckValveLeak off(nominal=0.0, p=1101325.0, runs=0.0, conductance=1e-9);
  Effects.CheckValveLeak on(nominal=0.01, p=1101325.0, runs=1.0, conductance=1e-9);
  Real missing(unit="s", start=0.0, fixed=true) "Delivery that is missing";
equation
  der(missing) = 1.0 - start.y;
  assert(abs(missing - 5.0*(1.0 - exp(-time/10.0))) < 1e-5, "A start costs something else");
  assert(abs(warming.actual - 0.01*(1.0 - 0.2*(0.5 - exp(-time/100.0)))) < 1e-8,
    "It does not warm up as said");
  assert(abs(off.actual + 1e-3) < 1e-12 and abs(on.actual - 0.01) <= 0.0, "The check valve");
  annotation (experiment(StopTime=60.0, Tolerance=1e-8));
end AStartCostsItsTime;
