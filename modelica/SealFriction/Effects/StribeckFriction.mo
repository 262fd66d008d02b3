within SealFriction.Effects;
model StribeckFriction "friction that falls as a film of grease forms"
  extends Common.Friction.Stribeck(v0=5e-4, vS=3e-3, excess(max=100.0));
  annotation (
    __Workbench(effect(
      size="excess", matters=0.2, shapes(vS={1.5e-3, 3e-3, 6e-3}),
      separation="strokes at rates down to 0.1 mm/s")),
    Documentation(info="<html>
<p>A peak of friction at the ends of a stroke, where the rate passes through zero.</p>
</html>"));
end StribeckFriction;
