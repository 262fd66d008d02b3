within ;
model Block "A block on a table"
  parameter Real m(unit = "kg") = 2.0;
  parameter Real coulomb(unit = "N") = 3.0;
  parameter Real v0(unit = "m/s") = 1e-5;
  input Real F(unit = "N");
  Real x(unit = "m", start = 0.0, fixed = true);
  Real v(unit = "m/s", start = 1.0, fixed = true);
equation
  der(x) = v;
  m*der(v) = F - coulomb*tanh(v/v0);
end Block;
