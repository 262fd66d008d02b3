within HeatedHouse.Tests;
model StoresFill "What a store took at last: its capacity times its rise"
  Effects.HeaterStore heater(power=1000.0, T=293.0, Ch=5e5);
  Effects.InteriorStore interior(nominal=0.0, T=294.0, G=190.0, Cm=1e6);
  Real taken(unit="J", start=0.0, fixed=true, nominal=1e6) "By the heater";
  Real stored(unit="J", start=0.0, fixed=true, nominal=1e6) "By what is inside";
equation
  der(taken) = 1000.0 - heater.heat;
  der(stored) = interior.actual;
  assert(time < 80000.0 or abs(taken - 2.5e5) < 20.0, "Not Ch*R*power");
  assert(time < 80000.0 or abs(stored - 1e6) < 50.0, "Not Cm times one kelvin");
  annotation (experiment(StopTime=90000.0, Tolerance=1e-9));
end StoresFill;
