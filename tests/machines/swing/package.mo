package Swing "A mass on a spring"
  model Observer "Its place"
    parameter Real w(unit="rad/s") = 6.283185307179586 "Angular frequency";
    input Real f(unit="m/s2") "Force over mass";
    input Real db(unit="m/s2") "Correction of b";
    parameter Real b(unit="m/s2") = 0.0 "Force that is not measured";
    output Real s(unit="m", start=0.5, fixed=true, nominal=0.5) "Place";
    output Real v(unit="m/s", start=0.0, fixed=true, nominal=3.0) "Speed";
  equation
    der(s) = v;
    der(v) = f + b + db - w^2*s;
  end Observer;
end Swing;
