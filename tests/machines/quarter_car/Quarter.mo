model Quarter "A quarter of a car on a shaker"
  parameter Real ms(unit="kg", min=50) = 300 "Body";
  parameter Real mu(unit="kg", min=5) = 40 "Wheel";
  parameter Real ks(unit="N/m", min=1000) = 20000 "Spring";
  parameter Real cs(unit="N.s/m", min=0) = 1500 "Damper";
  parameter Real kt(unit="N/m", min=10000) = 180000 "Tyre";
  input Real zr(unit="m") "Shaker";
  output Real a(unit="m/s2") "Acceleration of the body";
  output Real travel(unit="m") "Travel of the suspension";
  Real zs(unit="m", start=0, fixed=true, nominal=0.01);
  Real zu(unit="m", start=0, fixed=true, nominal=0.01);
  Real vs(unit="m/s", start=0, fixed=true, nominal=0.1);
  Real vu(unit="m/s", start=0, fixed=true, nominal=0.1);
equation
  der(zs) = vs;
  der(zu) = vu;
  a = (ks*(zu - zs) + cs*(vu - vs))/ms;
  der(vs) = a;
  mu*der(vu) = kt*(zr - zu) - ks*(zu - zs) - cs*(vu - vs);
  travel = zs - zu;
end Quarter;
