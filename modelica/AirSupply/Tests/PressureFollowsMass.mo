within AirSupply.Tests;
model PressureFollowsMass "The pressure rises with what is delivered, and falls with what is taken"
  Unit fills(COMP=0.0, dloss=0.0, delivery=0.02);
  Unit rests(COMP=1.0, dloss=0.0);
  Unit empties(COMP=1.0, dloss=1e-3);
  Real rate(unit="Pa/(kg/s)") = 287.05*293.15/0.4 "Of the pressure, per mass flow rate";
equation
  assert(abs(fills.reservoir - 9e5 - 0.02*rate*time) < 0.1, "Not filled in proportion");
  assert(abs(rests.reservoir - 9e5) < 1e-3, "It does not hold its pressure");
  assert(abs(empties.reservoir - 9e5 + 1e-3*rate*time) < 0.1, "Not emptied in proportion");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end PressureFollowsMass;
