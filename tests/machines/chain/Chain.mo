  connector Flange
    Real s(unit="m"); flow Real f(unit="N");
  end Flange;
  model Mass
    Flange flange; parameter Real m = 2.0;
    Real s(start=0.1, fixed=true, unit="m"); Real v(start=0.0, fixed=true, unit="m/s");
  equation
    flange.s = s; der(s) = v; m*der(v) = flange.f;
  end Mass;
  model Damper
    Flange a; Flange b; parameter Real k = 50.0; parameter Real c = 3.0;
    Real e; Real de;
  equation
    e = b.s - a.s; de = der(e); b.f = k*e + c*de; a.f = -b.f;
  end Damper;
  model Wall
    Flange flange;
  equation
    flange.s = 0.0;
  end Wall;
  model M
    Wall wall; Damper d[2](k={50.0, 70.0}); Mass m[2](m={2.0, 5.0});
    output Real force = d[1].b.f;
  equation
    connect(wall.flange, d[1].a); connect(d[1].b, m[1].flange);
    connect(m[1].flange, d[2].a); connect(d[2].b, m[2].flange);
  end M;
