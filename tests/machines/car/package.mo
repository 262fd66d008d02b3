within ;
package Car "A mass on a spring"
  partial model PartialSpring "Slot: force of the spring"
    input Real nominal(unit="N") "By its rate";
    input Real s(unit="m") "Travel";
    output Real actual(unit="N") "What it is";
  end PartialSpring;

  model Spring "Null version"
    extends PartialSpring;
  equation
    actual = nominal;
  end Spring;

  model Progressive "a spring that stiffens"
    extends PartialSpring;
    parameter Real k3(unit="N/m3", min=0.0, max=1e9) = 0.0 "Cubic rate";
  equation
    actual = nominal + k3*s^3;
    annotation (__Workbench(effect(size="k3", matters=2e4, separation="large travels")));
  end Progressive;

  model Observer "Mass on a road"
    parameter Real m(unit="kg") = 300.0 "Mass";
    parameter Real k(unit="N/m") = 20000.0 "Spring";
    parameter Real c(unit="N.s/m") = 1500.0 "Damper";
    input Real r(unit="m") "Road";
    input Real dc(unit="N.s/m") "Correction of c";
    output Real z(unit="m", start=0.0, fixed=true, nominal=0.02) "Height";
    Real y(unit="m/s", start=0.0, fixed=true, nominal=0.2) "Rise without the damper";
    replaceable Spring spring(nominal=k*(r - z), s=r - z)
      constrainedby PartialSpring(nominal=k*(r - z), s=r - z) "Spring";
  equation
    der(z) = y + (c + dc)/m*(r - z);
    der(y) = spring.actual/m;
  end Observer;
end Car;
