package Swing "Motions of known course"
  model Spring "A mass on a spring, undamped"
    parameter Real m(unit="kg") = 1.0;
    input Real F(unit="N");
    input Real dm(unit="kg");
    output Real s(unit="m", start=1.0, fixed=true);
    output Real v(unit="m/s", start=0.0, fixed=true);
    output Real R(unit="N") = F - 10.0*(s - 1.0) "What acts on it";
  equation
    der(s) = v;
    (m + dm)*der(v) = R;
  end Spring;
  model Relaxation "Van der Pol"
    parameter Real mu(unit="1") = 1000.0;
    input Real F(unit="1/s2");
    output Real s(unit="1", start=2.0, fixed=true);
    Real w(unit="1", start=0.0, fixed=true) "By Lienard";
  equation
    der(s) = mu*(s - s^3/3.0 - w) + F;
    der(w) = s/mu;
  end Relaxation;
  model Robertson "Three reactions, of which the fastest takes microseconds"
    input Real F(unit="1/s");
    output Real a(unit="1", start=1.0, fixed=true);
    Real b(unit="1", start=0.0, fixed=true);
    Real c(unit="1", start=0.0, fixed=true);
  equation
    der(a) = -0.04*a + 1e4*b*c + F;
    der(b) = 0.04*a - 1e4*b*c - 3e7*b^2;
    der(c) = 3e7*b^2;
  end Robertson;
end Swing;
