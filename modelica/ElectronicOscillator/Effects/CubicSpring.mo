within ElectronicOscillator.Effects;
model CubicSpring "a spring that stiffens with the square of the displacement"
  extends Interfaces.PartialForce;
  parameter Real k3(unit="1/V2", min=-100.0, max=100.0) = 0.0 "Force per cube of it";
equation
  f = k3*y^3;
  annotation (
    __Workbench(effect(
      size="k3", matters=0.05,
      separation="static force over displacement")),
    Documentation(info="<html>
<p><code>f = k3*y^3</code>.</p>
<h4>References</h4>
<p>G. Duffing (1918), Erzwungene Schwingungen bei ver&auml;nderlicher Eigenfrequenz.</p>
</html>"));
end CubicSpring;
