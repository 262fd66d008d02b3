package Coil "A coil in which a switched voltage drives a current"
  model Observer "Its current"
    parameter Real r(unit="V") = 0.0 "What is lost";
    input Real u(unit="V") "Voltage";
    input Real dr(unit="V") "Correction of r";
    output Real i(unit="A", start=0.0, fixed=true, nominal=5.0) "Current";
  equation
    0.006*der(i) = u - 2.0*i - (r + dr);
  end Observer;
end Coil;
