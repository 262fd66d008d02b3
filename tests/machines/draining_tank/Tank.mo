within ;
model Tank "A tank that drains, whose level is read late"
  parameter Real k(unit = "1/s") = 0.8 "Rate of the outlet";
  parameter Real c(unit = "1") = 1.5 "Gain of the sensor";
  parameter Real T(unit = "s") = 1e-4 "Time constant of the sensor, far below a step";
  input Real q(unit = "m/s");
  output Real y(unit = "m");
  Real h(unit = "m", start = 2.0, fixed = true);
  Real s(unit = "m", start = 2.0, fixed = true);
equation
  der(h) = q - k*h;
  T*der(s) = h - s;
  y = c*s;
end Tank;
