within WheelsetRig.Effects;
model WaterFilm "Water on all discs, until their friction has dried it"
  extends Brakes.PartialPadFriction(lack=lackBefore + (1.0 - wet)*loss);
  parameter Real film(unit="1", min=0.0, max=1.2) = 0.0 "Film at the start, 1 on a wet disc";
  parameter Units.FrictionCoefficient muWet = 0.12 "Friction of a wet disc";
  parameter Units.Energy E0(min=0.05e6, max=2e6) = 0.45e6
    "Friction energy that leaves 1/e of the film";
  parameter Real wet(unit="1", min=0.0, max=1.0) = 1.0 "Share of the discs that are wet";
  Units.Energy E(start=0.0, fixed=true, nominal=1e6) "Friction energy of one wet disc";
protected
  Units.FrictionCoefficient loss "Friction that a wet disc lacks";
equation
  loss = (level - muWet)*film*exp(-E/E0);
  mu = level - wet*loss;
  der(E) = (level - loss)*Fperp*abs(v);
  annotation (
    __Workbench(effect(
      size="film", matters=0.02,
      shapes(E0={0.1e6, 0.3e6, 0.45e6, 1e6}),
      where(condition="discs", is="wet", share="wet"),
      separation="venting the brake units one by one")),
    Documentation(info="<html>
<p><code>level - loss</code> is the friction of a wet disc, between dry and wet by the share of the
film that is left, <code>film*exp(-E/E0)</code>; <code>mu</code> is the mean of all discs. The film
leaves with friction energy, <code>der(E) = (level - loss)*Fperp*|v|</code>, not with time: at low
pressure it lasts longer, which tells it from bedding-in. Wet friction is 0.08 to 0.20; E0 is 0.05 to
1 MJ. Boiling off a film of 20 to 100 um takes 0.03 to 0.15 MJ; the rest of E0 is heat that the disc
keeps.</p>
<h4>Limits</h4>
<p>No water arrives after the start.</p>
<h4>References</h4>
<p>UIC 541-3 limits the difference of wet to dry friction to 15 % of the mean.</p>
</html>"));
end WaterFilm;
