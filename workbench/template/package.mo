package Tank "A tank that a pump fills and that empties through an outlet"
  partial model PartialOutlet "Slot: what leaves the tank"
    input Real nominal(unit="m3/s") "Through the outlet, by Torricelli's law";
    input Real h(unit="m") "Level";
    output Real actual(unit="m3/s") "What leaves the tank";
  end PartialOutlet;

  model Outlet "Null version: the outlet alone"
    extends PartialOutlet;
  equation
    actual = nominal;
  end Outlet;

  model Seepage "a wall that seeps in proportion to the level"
    extends PartialOutlet;
    parameter Real k(unit="m2/s", min=0.0, max=1e-2) = 0.0 "Seepage per level";
  equation
    actual = nominal + k*h;
    annotation (
      __Workbench(effect(
        size="k",
        step=2e-5,
        matters=1e-5,
        separation="the level over a night, with the outlet closed")),
      Documentation(info="<html>
<p>Laminar flow through pores (Darcy), unlike the turbulent flow of the outlet. Zero is the nominal
model exactly.</p>
</html>"));
  end Seepage;

  model Observer "The tank that observers run on"
    parameter Real A(unit="m2", min=0.01) = 0.5 "Area of the tank";
    parameter Real c(unit="m2", min=1e-5) = 1e-3 "Effective area of the outlet";
    parameter Real g(unit="m/s2") = 9.81 "Gravity";
    input Real inflow(unit="m3/s") "Of the pump";
    input Real dc(unit="m2") "Correction of c";
    output Real h(unit="m", start=1.0, fixed=true, nominal=1.0) "Level";
    output Real outflow(unit="m3/s") = outlet.actual "What leaves the tank";
    replaceable Outlet outlet(nominal=(c + dc)*v, h=h)
      constrainedby PartialOutlet(nominal=(c + dc)*v, h=h) "Outlet";
  protected
    Real v(unit="m/s") "Speed in the outlet";
  equation
    v = sqrt(2.0*g*sqrt(h^2 + 1e-6));  // smooth at an empty tank
    A*der(h) = inflow - outlet.actual;
  end Observer;
end Tank;
