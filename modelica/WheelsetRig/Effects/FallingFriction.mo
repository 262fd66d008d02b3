within WheelsetRig.Effects;
model FallingFriction "A contact whose friction falls with slip by more or less than Polach's"
  extends Contact.PartialAdhesion;
  parameter Real gain(unit="1", min=-0.9, max=1.5) = 0.0 "Relative change far into a slide";
  parameter Units.Velocity w0(min=0.1) = 5.0 "Slip that makes 1 - 1/e of it";
equation
  mu0 = level*(1.0 + gain*(1.0 - exp(-abs(w)/w0)));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.1,
      restarted(because="no wheel slides in these stops"),
      separation="a slip sweep by the drive at constant speed, up and down")),
    Documentation(info="<html>
<p><code>mu0 = level*(1 + gain*(1 - exp(-|w|/w0)))</code>, on top of Polach's <code>A + (1 - A)*exp(-B*|w|)</code>:
<code>A</code> is 0.3 to 0.6, <code>B</code> 0.1 to 0.8 s/m, by rail, and a hot contact falls too.
It shows in slides alone, and at once, where <code>AdhesionRecovery</code> needs energy.</p>
<h4>Limits</h4>
<p>Friction follows the slip velocity without memory. <code>w0</code> is not fitted: of slides that stay
below it, only <code>gain/w0</code> can be told.</p>
<h4>References</h4>
<p>O. Polach (2005), Wear 258, 992-1000; M. Ertz, K. Knothe (2002), Wear 253, 498-508.</p>
</html>"));
end FallingFriction;
