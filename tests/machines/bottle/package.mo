package Bottle "A closed bottle of gas"
  partial model PartialLeak "Slot: what leaves"
    input Real p(unit="Pa") "Pressure over that of the room";
    output Real rate(unit="Pa/s") "At which it falls";
  end PartialLeak;

  model Tight "Null version"
    extends PartialLeak;
  equation
    rate = 0.0;
  end Tight;

  model Pore "a pore that gas leaves by"
    extends PartialLeak;
    parameter Real k(unit="1/s", min=0.0, max=1.0) = 0.0 "Rate";
  equation
    rate = k*p;
    annotation (__Workbench(effect(
      size="k", matters=1e-5, separation="two pressures")));
  end Pore;

  model Permeation "gas that passes the wall at a constant rate"
    extends PartialLeak;
    parameter Real r(unit="Pa/s", min=-1e4, max=1e4) = 0.0 "Rate";
  equation
    rate = r;
    annotation (__Workbench(effect(size="r", matters=1, separation="two pressures")));
  end Permeation;

  model Observer "The bottle that observers run on"
    parameter Real k(unit="1/s") = 0.0 "Leak";
    input Real dk(unit="1/s") "Correction of k";
    output Real p(unit="Pa", start=5e5, fixed=true, nominal=1e5) "Pressure";
    replaceable Tight leak(p=p) constrainedby PartialLeak(p=p) "Leak";
  equation
    der(p) = -(k + dk)*p - leak.rate;
  end Observer;
end Bottle;
