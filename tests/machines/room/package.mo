package Room "A room that a heater warms"
  model Observer "Its temperature and the pressure of its air"
    parameter Real G(unit="W/K") = 50.0 "To the outside";
    input Real P(unit="W") "Heating";
    input Real dG(unit="W/K") "Correction of G";
    output Real T(unit="K", start=293.15, fixed=true, nominal=300.0, min=200.0) "Temperature";
    output Real p(unit="Pa") = 101325.0*T/293.15 "Pressure";
  equation
    1e5*der(T) = P - (G + dG)*(T - 273.15);
  end Observer;
end Room;
