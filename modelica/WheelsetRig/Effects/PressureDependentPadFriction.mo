within WheelsetRig.Effects;
model PressureDependentPadFriction "Pad friction that falls with the normal force"
  extends Brakes.PartialPadFriction;
  parameter Real exponent(unit="1", min=-0.1, max=0.2) = 0.0 "Exponent of the normal force";
  parameter Units.Force FRef(min=1000.0) = 35000.0 "Normal force at which the friction is nominal";
  parameter Units.Force FMin(min=1.0) = 1000.0 "Normal force below which the law is not followed";
equation
  mu = level*(noEvent(max(Fperp, FMin))/FRef)^(-exponent);
  annotation (
    __Workbench(effect(
      size="exponent", matters=0.004,
      separation="drag braking at constant roller speed, with a staircase of pressure up and down")),
    Documentation(info="<html>
<p><code>mu = level*(Fperp/FRef)^(-exponent)</code>, exponent 0 to 0.10: the area of true contact
grows slower than the force. Within a stop at constant pressure this is a change of the level; it
shows between pressures.</p>
<h4>References</h4>
<p>W. Sawczuk et al. (2021), <em>Materials</em> 14(16), 4766.</p>
</html>"));
end PressureDependentPadFriction;
