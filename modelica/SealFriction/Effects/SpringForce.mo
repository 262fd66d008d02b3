within SealFriction.Effects;
model SpringForce "a spring, or a bellows, along the stroke"
  extends Interfaces.PartialSpring;
  parameter Real c(unit="N/m", min=-1e3, max=1e3) = 0.0 "Stiffness";
equation
  f = c*s;
  annotation (
    __Workbench(effect(
      size="c", matters=12.0,
      separation="strokes without pressure")),
    Documentation(info="<html>
<p>Hoses and cables that hang on the piston are one, too.</p>
</html>"));
end SpringForce;
