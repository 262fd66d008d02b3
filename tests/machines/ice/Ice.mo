model Ice "A unit with a zero of its own, and no nominal value"
  parameter Real k(unit="1/s") = 0.01;
  input Real room(unit="degC", start=20.0);
  output Real box(unit="degC", start=4.0, fixed=true);
equation
  der(box) = k*(room - box);
end Ice;
