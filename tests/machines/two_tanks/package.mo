package Water
  model Tanks "A pump fills the first of two tanks, the second one drains and leaks"
    parameter Real area(unit="m2") = 0.5;
    parameter Real pipe(unit="m2/s") = 2e-3 "Flow per difference of levels";
    parameter Real drain(unit="m2/s") = 1e-3 "Flow per level";
    parameter Real leak(unit="m3/s") = 1e-4;
    parameter Real gain(unit="V/m") = 2.0;
    parameter Real offset(unit="V") = 0.4;
    input Real pump(unit="m3/s");
    input Real dleak(unit="m3/s") "Correction of leak";
    output Real h1(unit="m", start=1.0, fixed=true, nominal=1.0);
    output Real h2(unit="m", start=0.8, fixed=true, nominal=1.0);
    output Real reading(unit="V") = gain*h2 + offset;
    output Real outflow(unit="m3/s") = drain*h2;
  equation
    area*der(h1) = pump - pipe*(h1 - h2);
    area*der(h2) = pipe*(h1 - h2) - outflow - leak - dleak;
  end Tanks;
end Water;
