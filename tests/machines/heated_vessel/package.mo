package Heat
  model Vessel
    parameter Real rate(unit="1/s") = 0.02;
    parameter Real sun(unit="K/s") = 0.1;
    input Real heater(unit="K/s");
    input Real dsun(unit="K/s");
    output Real warm(unit="K", start=10.0, fixed=true, nominal=10.0);
  equation
    der(warm) = heater + sun + dsun - rate*warm;
  end Vessel;
end Heat;
