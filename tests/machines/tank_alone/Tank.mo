model Tank "A tank that empties through an outlet"
  parameter Real A(unit="m2", min=0.01) = 0.5 "area of the tank";
  parameter Real c(unit="m2", min=1e-5) = 1e-3 "effective area of the outlet";
  parameter Real g(unit="m/s2") = 9.81 "gravity";
  parameter Real leak(unit="m3/s") = 0.0 "steady leak";
  input Real inflow(unit="m3/s");
  Real x(unit="m", start=1.0, fixed=true, min=0.0, max=3.0) "level";
  output Real h(unit="m") = x;
equation
  A*der(x) = inflow - c*sqrt(2.0*g*sqrt(x^2 + 1e-6)) - leak;
end Tank;
