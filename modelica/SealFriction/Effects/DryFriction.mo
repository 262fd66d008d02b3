within SealFriction.Effects;
model DryFriction "dry friction of the seal, at any pressure"
  extends Common.Friction.Dry(v0=5e-4, coulomb(max=100.0));
  annotation (
    __Workbench(effect(
      size="coulomb", matters=0.2,
      separation="strokes without pressure")),
    Documentation(info="<html>
<p>A ring that is squeezed into its groove presses on the wall also without pressure.</p>
<h4>References</h4>
<p>H. K. Mueller, B. S. Nau (1998), <em>Fluid Sealing Technology</em>, Marcel Dekker: friction of
O-rings by squeeze and by pressure.</p>
</html>"));
end DryFriction;
