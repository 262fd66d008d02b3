package Swing "A mass on a spring"
  model Mass "Mass, spring and damper"
    parameter Real w(unit="rad/s") = 1.0;
    parameter Real a(unit="1/s") = 1.0;
    input Real f(unit="m/s2");
    output Real y(unit="m", start=1.0, fixed=true);
    Real v(unit="m/s", start=0.0, fixed=true);
  equation
    der(y) = v;
    der(v) = f - w^2*y - 2.0*a*v;
  end Mass;
end Swing;
