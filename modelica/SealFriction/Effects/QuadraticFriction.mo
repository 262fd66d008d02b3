within SealFriction.Effects;
model QuadraticFriction "air that is throttled on its way in and out"
  extends Common.Friction.Quadratic(drag(max=1e6));
  annotation (
    __Workbench(effect(
      size="drag", matters=2e3,
      separation="strokes at rates a decade apart")),
    Documentation(info="<html>
<p>A pressure sensor far from the piston does not see what falls between them, with the square of the
flow.</p>
</html>"));
end QuadraticFriction;
