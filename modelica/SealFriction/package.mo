package SealFriction "Force of a pneumatic cylinder, with the friction of its seal"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>A cylinder that is moved in and out at constant pressure, while its force is measured: the test by
which seals are compared. Between pressure and force there is the area, and the friction of the
seal.</p>
<h4>Signs</h4>
<p>The force that is measured pushes the piston in, against the pressure; the stroke grows as the
piston goes in. Friction resists: it adds to the force on the way in, and takes from it on the way
out.</p>
</html>"));
end SealFriction;
