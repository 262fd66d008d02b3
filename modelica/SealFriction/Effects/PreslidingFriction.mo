within SealFriction.Effects;
model PreslidingFriction "a seal that is sheared before it slides"
  extends Common.Interfaces.Friction;
  parameter Real coulomb(unit="N", min=0.0, max=100.0) = 0.0 "Friction while it slides";
  parameter Real delta(unit="m", min=1e-5, max=5e-3) = 5e-4
    "Way in which friction turns from one side to the other, over 2";
  Real side(unit="1", start=0.0, fixed=true) "Friction over that while it slides";
equation
  der(side) = (v - abs(v)*side)/delta;
  f = coulomb*side;
  annotation (
    __Workbench(effect(
      size="coulomb", matters=0.2, shapes(delta={1e-4, 3e-4, 1e-3}),
      separation="strokes of less than a millimetre")),
    Documentation(info="<html>
<p><code>f = coulomb*side</code>, <code>delta*der(side) = v - |v|*side</code>: rubber bends before it
slides, so that friction follows the way since the last turn, not the rate.</p>
<h4>References</h4>
<p>P. R. Dahl (1968), <em>A solid friction model</em>, Aerospace Corporation, TOR-0158(3107-18)-1.</p>
</html>"));
end PreslidingFriction;
