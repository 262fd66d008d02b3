within ElectronicOscillator.Effects;
model SquareSpring "a spring that is stiffer the more it is on one side"
  extends Interfaces.PartialForce;
  parameter Real k2(unit="1/V", min=-10.0, max=10.0) = 0.0 "Force per square of the displacement";
equation
  f = k2*y^2;
  annotation (
    __Workbench(effect(
      size="k2", matters=0.01,
      separation="static force over displacement")),
    Documentation(info="<html>
<p><code>f = k2*y^2</code>: a component that is not symmetric.</p>
</html>"));
end SquareSpring;
