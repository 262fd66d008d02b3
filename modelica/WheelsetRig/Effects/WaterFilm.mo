within WheelsetRig.Effects;
model WaterFilm "Pad friction that water on all discs lowers until it has dried"
  extends Brakes.PartialPadFriction;
  parameter Real depth(unit="1", min=0.0, max=0.7) = 0.0 "Share of friction lost at full film";
  parameter Units.Energy E0(min=0.05e6, max=2e6) = 0.45e6
    "Friction energy that leaves 1/e of the film";
  Units.Energy E(start=0.0, fixed=true, nominal=1e6) "Friction energy of one disc";
equation
  mu = level*(1.0 - depth*exp(-E/E0));
  der(E) = mu*Fperp*abs(v);
  annotation (Documentation(info="<html>
<p><code>mu = level*(1 - depth*exp(-E/E0))</code>, <code>der(E) = mu*Fperp*|v|</code>. The film
leaves with friction energy, not with time: at low pressure it lasts longer, which tells it from
bedding-in. Wet friction is 0.08 to 0.20, so depth is 0.3 to 0.7; E0 is 0.05 to 1 MJ. Boiling off a
film of 20 to 100 um takes 0.03 to 0.15 MJ; the rest of E0 is heat that the disc keeps.</p>
<h4>Limits</h4>
<p>No water arrives after the start.</p>
<h4>References</h4>
<p>UIC 541-3 limits the difference of wet to dry friction to 15 % of the mean.</p>
</html>"));
end WaterFilm;
