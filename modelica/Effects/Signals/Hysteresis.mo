within Effects.Signals;
model Hysteresis "A share that friction keeps back after a rise, and adds after a fall"
  extends Play(play=0.1);
  parameter Real share(unit="1", min=0.0, max=1.0) = 0.0 "Of the value";
protected
  Real side(unit="1") "Place within the play, -1 to 1";
equation
  side = noEvent(max(-1.0, min(1.0, (felt - centre)/play)));
  y = u - share*side*u;
  annotation (Documentation(info="<html>
<p><code>y = u*(1 - share*side)</code>: <code>side</code> is 1 after a rise, -1 after a fall, kept while
the value holds. The width of the play, <code>2*play</code>, is the change over which one turns into
the other, above 0.</p>
</html>"));
end Hysteresis;
