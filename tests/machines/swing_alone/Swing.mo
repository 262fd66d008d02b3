model Swing "A mass on a spring"
  parameter Real m(unit="kg") = 1.0 "mass";
  parameter Real c(unit="N/m") = 10.0 "stiffness";
  output Real s(unit="m", start=0.5, fixed=true) "position";
  Real v(unit="m/s", start=0.0, fixed=true) "speed";
equation
  der(s) = v;
  m*der(v) = -c*s;
end Swing;
