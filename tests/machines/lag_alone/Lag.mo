model Lag
  parameter Real k = 0.5 "loss";
  input Real u(start=1.0);
  Real x(start=2.0, fixed=true);
  output Real $outputs = x;
equation
  der(x) = u - k*x;
end Lag;
