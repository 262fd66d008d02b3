within HeatedHouse.Tests;
model HeatIsKept "1 kW for ten hours is in the house, or has left it"
  House house(Ta=273.0, sun=100.0, heating=1000.0, dQ=0.0,
    redeclare Effects.HeaterStore heater(Ch=5e5),
    redeclare Effects.ShellStore shell(Ce=1e7));
  Real lost(unit="J", start=0.0, fixed=true, nominal=1e7) "Through the outer part of the walls";
equation
  der(lost) = 190.0/0.7*(house.shell.Te - 273.0);
  // Rounded by (window/(R*Ch))^2/2 = 0.7 % of what the heaters, some 2e5 J, hold, and less of the walls.
  assert(abs(7.5e6*(house.T - 293.0) + 5e5*(house.heater.Th - 293.0) + 1e7*(house.shell.Te - 290.0)
    + lost - 1800.0*time) < 2e4, "Heat is lost or made");
  annotation (experiment(StopTime=36000.0, Tolerance=1e-9));
end HeatIsKept;
