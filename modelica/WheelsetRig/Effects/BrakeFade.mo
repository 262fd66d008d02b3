within WheelsetRig.Effects;
model BrakeFade "Pad friction that falls with the temperature of the disc"
  extends Brakes.PartialPadFriction;
  parameter Real fade(unit="1/K", min=-5e-4, max=2e-3) = 0.0 "Relative fall per kelvin";
  parameter Units.Temperature TRef = 373.15 "Temperature at which the friction is nominal";
  parameter Units.Temperature TAmbient = 293.15 "Temperature of the air";
  parameter Real C(unit="J/K", min=1000.0) = 75.0*500.0 "Heat capacity of one friction ring";
  parameter Real share(unit="1", min=0.0, max=1.0) = 0.93 "Share of the heat; pads take the rest";
  parameter Real circumferential(unit="1", min=0.0) = 0.46/0.30
    "Wheel radius over radius of the pads";
  Real rise(unit="K", start=0.0, fixed=true, nominal=100.0) "Since the stop began";
  Units.Temperature T = TBefore + rise "Temperature of the disc";
protected
  Real cooling(unit="W/K") "Convection of one disc";
equation
  mu = level*(1.0 - fade*(T - TRef));
  // (v^2 + 0.1^2)^0.4 for |v|^0.8: its slope stays finite at standstill.
  cooling = 20.0 + 5.0*((circumferential*v)^2 + 0.01)^0.4;
  C*der(rise) = share*mu*Fperp*abs(v) - cooling*(T - TAmbient);
  annotation (
    __Workbench(effect(
      size="fade", matters=3e-5,
      separation="stops repeated without cooling, then one after 20 minutes")),
    Documentation(info="<html>
<p><code>mu = level*(1 - fade*(T - TRef))</code>, fade 0 to 1e-3 per kelvin. The disc is one lump of
steel of 1 m2, heated by its own friction, <code>C*der(T) = share*mu*Fperp*|v| - h(v)*(T -
TAmbient)</code>, with <code>h = 20 + 5*v^0.8</code> W/m2/K at the circumferential speed of the
wheel in m/s: convection at a rotating disc. A hot disc starts the next stop lower, unlike with
friction that depends on speed.</p>
<h4>Limits</h4>
<p>No surface temperature: what follows power within seconds is missing.</p>
<h4>References</h4>
<p>J. Topczewska et al. (2022), <em>Materials</em> 15(19), 6821.</p>
</html>"));
end BrakeFade;
