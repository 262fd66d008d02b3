within SealFriction.Effects;
model ViscousFriction "friction of grease between seal and wall"
  extends Common.Friction.Viscous(damping(max=1e4));
  annotation (
    __Workbench(effect(
      size="damping", matters=20.0,
      separation="strokes at rates a decade apart")),
    Documentation(info="<html>
<p>Some hundred N.s/m are usual with greased seals of this size.</p>
</html>"));
end ViscousFriction;
