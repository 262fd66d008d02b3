within Effects.Signals;
partial model Play "Where a value stands within the play of a linkage"
  extends Interfaces.Signal;
  parameter Real play(min=0.0) = 0.0 "From the middle to one side, in the unit of the value";
  parameter Real tau(unit="s", min=1e-3) = 0.1 "Time in which the linkage follows at the end of its play";
  parameter Real smoothing(unit="s", min=1e-3) = 0.02 "Time over which noise of u is averaged";
  Real felt(start=0.0, fixed=true) "Value that moves the linkage";
  Real centre(start=0.0, fixed=true) "Middle of the play";
equation
  smoothing*der(felt) = u - felt;
  tau*der(centre) =
    noEvent(max(0.0, felt - centre - play)) + noEvent(min(0.0, felt - centre + play));
  annotation (Documentation(info="<html>
<p>The play operator: <code>centre</code> stays where it is until <code>felt</code> reaches one side of
the play, which takes it along. Noise of a measured value would push the play along, a little with
each peak: it is averaged over <code>smoothing</code>.</p>
<h4>Limits</h4>
<p>One play; inner loops need more of them (Preisach). At the start the value is 0, in the middle of
the play; modifiers <code>felt(start=...)</code> and <code>centre(start=...)</code> say otherwise.</p>
<h4>References</h4>
<p>M. A. Krasnosel'skii, A. V. Pokrovskii (1989), <em>Systems with Hysteresis</em>, Springer.</p>
</html>"));
end Play;
