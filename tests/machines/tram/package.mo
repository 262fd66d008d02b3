package Tram "A tram of which power and speed are measured"
  model Observer "Its speed"
    parameter Real m(unit="kg") = 35e3 "Mass";
    parameter Real e(unit="1") = 0.8 "Efficiency";
    parameter Real A(unit="m/s2") = 0.02 "Resistance";
    input Real P(unit="W") "Electric power";
    input Real dm(unit="kg") "Correction of m";
    input Real de(unit="1") "Correction of e";
    input Real dA(unit="m/s2") "Correction of A";
    output Real v(unit="m/s", start=5.0, fixed=true, nominal=10.0) "Speed";
  equation
    der(v) = (e + de)*P/((m + dm)*sqrt(v^2 + 1.0)) - (A + dA)*v;
  end Observer;
end Tram;
