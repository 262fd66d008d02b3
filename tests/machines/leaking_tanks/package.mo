package Water
  partial model Tanks
    parameter Real area(unit="m2") = 0.5;
    parameter Real pipe(unit="m2/s") = 2e-3;
    parameter Real drain(unit="m2/s") = 1e-3;
    parameter Real leak(unit="m3/s") = 1e-4;
    input Real pump(unit="m3/s");
    input Real dleak(unit="m3/s");
    output Real h1(unit="m", start=1.0, fixed=true, nominal=1.0);
    output Real h2(unit="m", start=0.8, fixed=true, nominal=1.0);
    output Real reading(unit="V");
    output Real lost(unit="m3/s");
  equation
    area*der(h1) = pump - pipe*(h1 - h2);
    area*der(h2) = pipe*(h1 - h2) - drain*h2 - lost;
  end Tanks;
  model Linear
    extends Tanks;
  equation
    reading = 2.0*h2 + 0.4;
    lost = leak + dleak;
  end Linear;
  model Bent
    extends Tanks;
  equation
    reading = 3.0*sqrt(h2);
    lost = 5e3*(leak + dleak)^2;
  end Bent;
end Water;
