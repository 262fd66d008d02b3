within WheelsetRig.Effects;
model CaliperHysteresis "Friction in the caliper"
  extends Brakes.PartialCylinder;
  parameter Real share(unit="1", min=0.0, max=0.15) = 0.0
    "Share of force lost after a rise of pressure, gained after a fall";
  parameter Units.Pressure play(min=0.01e5, max=0.5e5) = 0.1e5
    "Change of pressure from the middle to one side";
  parameter Units.Pressure p0(min=0.0) = 25000.0 "Pressure that balances the return spring";
  parameter Real tau(unit="s", min=1e-3) = 0.1
    "Time in which the caliper follows at the end of its play";
  parameter Real smoothing(unit="s", min=1e-3) = 0.02 "Time over which noise of pB is averaged";
  Units.Pressure felt(start=0.0, fixed=true, nominal=1e5) "Pressure that moves the caliper";
  Units.Pressure centre(start=0.0, fixed=true, nominal=1e5) "Middle of the play";
protected
  Real side(unit="1") "Place within the play, -1 to 1";
equation
  smoothing*der(felt) = pB - felt;
  tau*der(centre) =
    noEvent(max(0.0, felt - centre - play)) + noEvent(min(0.0, felt - centre + play));
  side = noEvent(max(-1.0, min(1.0, (felt - centre)/play)));
  p = pB - share*side*noEvent(max(0.0, pB - p0));
  rest = restBefore;
  annotation (
    __Workbench(effect(
      size="share", matters=0.02,
      falling(signal="pB", because="brake pressure never falls in these stops"),
      separation="drag braking at constant roller speed, with a staircase of pressure up and down")),
    Documentation(info="<html>
<p><code>p - p0 = (pB - p0)*(1 - share*side)</code>. <code>side</code> is the place within a play of
width <code>2*play</code>: 1 after a rise, -1 after a fall, kept while the pressure holds. Noise of
a measured pressure would push the play along, a little with each peak: it is averaged over
<code>smoothing</code>. share is 0.02 to 0.08.</p>
<h4>Limits</h4>
<p>One play; inner loops need more of them (Preisach). While pressure only rises this is a change of
the level.</p>
<h4>References</h4>
<p>M. A. Krasnosel'skii, A. V. Pokrovskii (1989), <em>Systems with Hysteresis</em>, Springer: the
play operator.</p>
</html>"));
end CaliperHysteresis;
