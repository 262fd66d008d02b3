within HeatedHouse.Tests;
model StoresFill "What a store took at last: its capacity times its rise"
  Effects.HeaterStore heater(power=1000.0, T=293.0, Ch=2e3, window=1e-3);
  Effects.InteriorStore interior(nominal=0.0, T=294.0, G=190.0, Cm=1e3, lag(min=1.0)=1.0);
  Real taken(unit="J", start=0.0, fixed=true, nominal=1e3) "By the heater";
  Real stored(unit="J", start=0.0, fixed=true, nominal=1e3) "By what is inside";
equation
  der(taken) = 1000.0 - heater.heat;
  der(stored) = interior.actual;
  // 20 s are 20 lags, after which 2e-9 is missing.
  assert(time < 20.0 or abs(taken - 1000.0) < 1e-3, "Not Ch*R*power");
  assert(time < 20.0 or abs(stored - 1000.0) < 1e-3, "Not Cm times one kelvin");
  annotation (experiment(StopTime=25.0, Tolerance=1e-9));
end StoresFill;
